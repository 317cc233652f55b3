/// \file scan_outputs.h
/// Where commands of surveys write: LAS and LAZ files that each get a copy, and texts.
#pragma once
#include <filesystem>
#include <string>
#include <vector>

namespace tessera {

/// A folder that is there, or a name that ends like one.
bool names_folder(const std::filesystem::path& path);
/// A file in the folder for each input, named like it; of COPC without what names its octree, which is not written.
/// \param why  what is said of other formats  \throws InputError for these, UsageError where two get one name
std::vector<std::filesystem::path> outputs_in_folder(const std::vector<std::filesystem::path>& inputs,
                                                     const std::filesystem::path& folder,
                                                     const std::string& why);
/// \throws UsageError when it cannot be made
void make_output_folder(const std::filesystem::path& folder);
/// Under its final name once all is written; nothing for an empty path. \throws UsageError, ResourceError as OutputFile
void write_text_output(const std::filesystem::path& path, const std::string& text);

}  // namespace tessera

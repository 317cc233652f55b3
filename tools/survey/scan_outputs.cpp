#include "tools/survey/scan_outputs.h"

#include <map>

#include "octree/error.h"
#include "stream/files/file_extension.h"
#include "stream/files/output_file.h"

namespace tessera {
namespace {

std::filesystem::path copied_name(const std::filesystem::path& input) {
  std::filesystem::path name = input.filename();
  if (lower_extension(name) == ".laz" && lower_extension(name.stem()) == ".copc")
    return name.stem().stem().string() + ".laz";
  return name;
}

}  // namespace

bool names_folder(const std::filesystem::path& path) {
  std::error_code ignored;
  return !path.has_filename() || std::filesystem::is_directory(path, ignored);
}

std::vector<std::filesystem::path> outputs_in_folder(const std::vector<std::filesystem::path>& inputs,
                                                     const std::filesystem::path& folder,
                                                     const std::string& why) {
  std::vector<std::filesystem::path> outputs;
  std::map<std::filesystem::path, std::filesystem::path> taken;
  for (const std::filesystem::path& input : inputs) {
    const std::filesystem::path output = folder / copied_name(input);
    const std::string extension = lower_extension(input);
    if (extension != ".las" && extension != ".laz")
      throw InputError(input.string() + ": is neither LAS nor LAZ, and " + why);
    const auto [at, fresh] = taken.emplace(output, input);
    if (!fresh)
      throw UsageError(output.string() + ": would be written for " + at->second.string() + " and for " +
                       input.string() + "; name two folders, in two calls");
    outputs.push_back(output);
  }
  return outputs;
}

void make_output_folder(const std::filesystem::path& folder) {
  std::error_code error;
  std::filesystem::create_directories(folder, error);
  if (error) throw UsageError("-o " + folder.string() + ": cannot be made: " + error.message());
}

void write_text_output(const std::filesystem::path& path, const std::string& text) {
  if (path.empty()) return;
  OutputFile file(path);
  file.append(text);
  file.finish();
}

}  // namespace tessera

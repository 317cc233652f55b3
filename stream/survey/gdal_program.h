/// \file gdal_program.h
/// `tessera-gdal`, the program that links GDAL: it makes foreign files of raw ones, in a scratch folder.
#pragma once
#include <cstdint>
#include <filesystem>
#include <string>

#include "stream/files/json.h"

namespace tessera {

/// Where it is. \throws ResourceError when it is not there
std::filesystem::path gdal_program();

/// The coordinate system that its files get: `given` (WKT, a code, or a file with either), else what lies beside the mesh; empty = none.
/// \throws UsageError, or InputError for what lies beside the mesh, where that is no coordinate system
std::string surveyed_crs(const std::filesystem::path& mesh, const std::string& given);

/// Lets it do what a request says and gives its result the final name.
/// \param scratch  folder for the request and the result
/// \param command  of tools/survey/gdal_export.cpp \param request  what it reads; `result` is added
/// \returns what it warns of, lines; may be empty
/// \throws what it fails by; as OutputFile
std::string write_by_gdal(const std::filesystem::path& scratch, const std::string& command, Json request,
                          std::uint64_t memory_bytes, const std::filesystem::path& output);

}  // namespace tessera

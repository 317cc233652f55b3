/// \file reconstruct_command.h
/// `tessera reconstruct` as tests run it, and what they look at afterwards.
#pragma once
#include <catch2/catch.hpp>

#include <filesystem>
#include <string>
#include <vector>

#include "stream/check/mesh_check.h"
#include "stream/files/json.h"
#include "stream/formats/meshes/mesh_io.h"
#include "tests/helpers/command.h"
#include "tests/helpers/temp_folder.h"

namespace tessera::test {

/// The words of a quiet job.
inline std::vector<std::string> reconstruct_words(const std::string& in, const std::filesystem::path& out,
                                                  const std::vector<std::string>& more) {
  std::vector<std::string> words = {"reconstruct", in, "-o", out.string(), "--progress", "none", "-q"};
  words.insert(words.end(), more.begin(), more.end());
  return words;
}

/// Its report. \pre the job is to succeed
inline tessera::Json reconstructed(const std::string& in, const std::filesystem::path& out,
                                   const std::vector<std::string>& more) {
  const CommandResult r = tessera_command(reconstruct_words(in, out, more));
  INFO(r.errors);
  REQUIRE(r.code == 0);
  return tessera::parse_json(file_bytes(out.string() + ".report.json"));
}

/// What the end of a stage told; null where there is none.
inline tessera::Json stage_result(const tessera::Json& report, const std::string& name) {
  for (const auto& entry : report.at("stages"))
    if (entry.at("name") == name) return entry.at("result");
  return {};
}

inline MeshCheck checked(const std::filesystem::path& file, const std::filesystem::path& temp) {
  MeshCheckOptions options;
  options.temp = temp;
  return check_mesh(*open_mesh_file(file), options);
}

}  // namespace tessera::test

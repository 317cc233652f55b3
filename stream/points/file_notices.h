/// \file file_notices.h
/// What is to be told of many files, a line for every kind: how many files it is about, and the first three.
#pragma once
#include <cstddef>
#include <filesystem>
#include <map>
#include <string>
#include <vector>

#include "stream/formats/points/point_source.h"

namespace tessera {

/// Sentences are of one kind where they differ in numbers only; of each the first is shown.
class FileNotices {
 public:
  void add(const std::filesystem::path& file, const std::string& sentence);
  /// Warnings of its header, and fields that are left out.
  void add(const PointFileInfo& info);
  /// "a.las: sentence" or "12 files (a.las, b.las, c.las, ...): sentence", by kind; at most 32 kinds.
  std::vector<std::string> lines() const;

 private:
  struct Kind {
    std::string first;
    std::vector<std::string> names;
    std::size_t count = 0;
  };
  std::map<std::string, Kind> kinds_;
};

}  // namespace tessera

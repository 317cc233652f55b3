#include "stream/points/file_notices.h"

#include "stream/files/path_text.h"

namespace tessera {

void FileNotices::add(const std::filesystem::path& file, const std::string& sentence) {
  constexpr std::size_t kNamed = 3;
  constexpr std::size_t kMaxKinds = 32;
  std::string key;
  for (const char c : sentence)
    if (c < '0' || c > '9') key += c;
  if (kinds_.size() >= kMaxKinds && kinds_.count(key) == 0) return;
  Kind& kind = kinds_[key];
  if (kind.count++ == 0) kind.first = sentence;
  if (kind.names.size() < kNamed) kind.names.push_back(file.filename().string());
}

void FileNotices::add(const PointFileInfo& info) {
  for (const std::string& w : info.warnings) add(info.path, w);
  if (!info.left_out.empty()) add(info.path, left_out_sentence(info));
}

std::vector<std::string> FileNotices::lines() const {
  std::vector<std::string> lines;
  for (const auto& [key, kind] : kinds_) {
    std::string line = kind.count > 1 ? std::to_string(kind.count) + " files (" : "";
    for (std::size_t i = 0; i < kind.names.size(); ++i) line += (i > 0 ? ", " : "") + kind.names[i];
    if (kind.count > kind.names.size()) line += ", ...";
    lines.push_back(json_text(line + (kind.count > 1 ? "): " : ": ") + kind.first));
  }
  return lines;
}

}  // namespace tessera

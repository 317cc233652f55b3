/// \file patch_cache.h
/// What a task read of patches and may need again.
#pragma once
#include <cstddef>
#include <cstdint>
#include <list>
#include <unordered_map>
#include <utility>

namespace tessera {

/// What was read of patches, kept as long as it is small; what was not asked for the longest time goes first.
/// \tparam Read  has bytes(), what it holds
template <class Read>
class PatchCache {
 public:
  explicit PatchCache(std::uint64_t max_bytes) : max_bytes_(max_bytes) {}

  /// Null where the patch is not kept; else as get().
  const Read* find(std::size_t patch) {
    const auto found = place_.find(patch);
    if (found == place_.end()) return nullptr;
    read_.splice(read_.begin(), read_, found->second);
    return &found->second->second;
  }
  /// \param load  (Read&) fills it where the patch is not kept
  /// \returns a reference that holds until another patch is asked for
  template <class Load>
  const Read& get(std::size_t patch, const Load& load) {
    if (const Read* found = find(patch)) return *found;
    while (bytes_ > max_bytes_ && !read_.empty()) {
      bytes_ -= read_.back().second.bytes();
      place_.erase(read_.back().first);
      read_.pop_back();
    }
    Read out;
    load(out);
    bytes_ += out.bytes();
    read_.emplace_front(patch, std::move(out));
    place_[patch] = read_.begin();
    return read_.front().second;
  }

 private:
  std::uint64_t max_bytes_, bytes_ = 0;
  std::list<std::pair<std::size_t, Read>> read_;  ///< that asked for last first
  std::unordered_map<std::size_t, typename std::list<std::pair<std::size_t, Read>>::iterator> place_;
};

}  // namespace tessera

/// \file progress_share.h
/// A step inside a stage that counts its own units, as a share of those of the stage.
#pragma once
#include <algorithm>
#include <cstdint>
#include <filesystem>
#include <string>

#include "stream/runtime/stage.h"

namespace tessera {

/// Hands everything on, but for progress: `steps` of advance() are `share` units outside, however few or many steps come
/// in truth. One thread.
class ProgressShare : public TaskContext {
 public:
  /// \param steps  about how many there will be; 0 = unknown: all progress comes with complete()
  ProgressShare(TaskContext& outer, std::uint64_t steps, std::uint64_t share)
      : outer_(outer), steps_(steps), share_(share) {}
  std::filesystem::path create(const std::string& name) override { return outer_.create(name); }
  void check_stop() const override { outer_.check_stop(); }
  void count_read(std::uint64_t bytes) override { outer_.count_read(bytes); }
  void count_written(std::uint64_t bytes) override { outer_.count_written(bytes); }

  void advance(std::uint64_t steps) override {
    done_ += steps;
    if (steps_ > 0)
      tell(static_cast<std::uint64_t>(
          static_cast<double>(share_) *
          std::min(1.0, static_cast<double>(done_) / static_cast<double>(steps_))));
  }
  /// The rest of the share: the step is done.
  void complete() { tell(share_); }

 private:
  void tell(std::uint64_t units) {
    if (units <= told_) return;
    outer_.advance(units - told_);
    told_ = units;
  }

  TaskContext& outer_;
  std::uint64_t steps_, share_;
  std::uint64_t done_ = 0, told_ = 0;
};

}  // namespace tessera

#include "stream/runtime/progress.h"

#include <algorithm>

#include <fmt/format.h>

#include "octree/error.h"
#include "stream/files/json.h"
#include "stream/runtime/memory_budget.h"

namespace tessera {
namespace {

using Clock = std::chrono::steady_clock;
constexpr auto kSample = std::chrono::milliseconds(50);
constexpr auto kLine = std::chrono::seconds(5);
constexpr auto kRedraw = std::chrono::milliseconds(200);
constexpr std::size_t kBarWidth = 24;

/// "12.3 M"
std::string short_count(double value) {
  const char* unit = "";
  for (const char* next : {" k", " M", " G", " T"}) {
    if (value < 1000.0) break;
    value /= 1000.0;
    unit = next;
  }
  return fmt::format("{:.{}f}{}", value, *unit == '\0' || value >= 100 ? 0 : 1, unit);
}

std::string short_time(double seconds) {
  const auto s = static_cast<std::uint64_t>(std::max(0.0, seconds));
  if (s < 60) return fmt::format("{} s", s);
  if (s < 3600) return fmt::format("{}:{:02} min", s / 60, s % 60);
  return fmt::format("{}:{:02} h", s / 3600, s / 60 % 60);
}

double progress_seconds(Clock::time_point start) {
  return std::chrono::duration<double>(Clock::now() - start).count();
}

void take_note(const ProgressSink& sink, const JobProgress& at) {
  if (const auto* notes = sink.write.target<ProgressNotes>(); notes != nullptr && notes->take)
    notes->take(at);
}

}  // namespace

ProgressMode progress_mode(const std::string& name, bool terminal, int verbosity) {
  if (verbosity < 0 || name == "none") return ProgressMode::kNone;
  if (name == "json") return ProgressMode::kJson;
  if (name == "plain") return ProgressMode::kPlain;
  if (name == "auto" || name == "bar") return terminal ? ProgressMode::kBar : ProgressMode::kPlain;
  throw UsageError(fmt::format("--progress {}: is none of auto, bar, plain, json, none", name));
}

Progress::Progress(ProgressMode mode, ProgressSink sink)
    : mode_(sink.write ? mode : ProgressMode::kNone), sink_(std::move(sink)), thread_([this] { watch(); }) {}

Progress::~Progress() {
  {
    const std::lock_guard lock(mutex_);
    quit_ = true;
  }
  wake_.notify_all();
  thread_.join();
}

void Progress::begin_stage(const std::string& name, std::size_t index, std::size_t count,
                           const std::string& unit, std::uint64_t total, std::uint64_t done) {
  const std::lock_guard lock(mutex_);
  name_ = name;
  unit_ = unit;
  index_ = index;
  count_ = count;
  total_ = total;
  before_ = done;
  done_.store(done);
  peak_before_ = peak_resident_bytes();
  sampled_peak_ = resident_bytes();
  start_ = Clock::now();
  next_line_ = start_ + (mode_ == ProgressMode::kBar ? Clock::duration::zero() : Clock::duration(kLine));
  active_ = true;
  wake_.notify_all();
}

std::uint64_t Progress::stage_peak_bytes() {
  const std::lock_guard lock(mutex_);
  const std::uint64_t peak = peak_resident_bytes();
  return peak > peak_before_ ? peak : std::max(sampled_peak_, resident_bytes());
}

void Progress::end_stage() {
  const std::lock_guard lock(mutex_);
  active_ = false;
  take_note(sink_, {name_, index_, count_, unit_, done_.load(), total_, progress_seconds(start_), true});
  draw(true);
}

void Progress::say(const std::string& text) {
  const std::lock_guard lock(mutex_);
  if (mode_ == ProgressMode::kNone) return;
  if (mode_ == ProgressMode::kJson) {
    sink_.write(dump_json(Json({{"event", "message"}, {"text", text}})) + "\n");
    return;
  }
  sink_.write((mode_ == ProgressMode::kBar ? "\r\x1b[K" : "") + text + "\n");
}

void Progress::watch() {
  std::unique_lock lock(mutex_);
  while (!quit_) {
    if (!active_) {
      wake_.wait(lock);
      continue;
    }
    wake_.wait_for(lock, kSample);
    if (quit_ || !active_) continue;
    sampled_peak_ = std::max(sampled_peak_, resident_bytes());
    take_note(sink_, {name_, index_, count_, unit_, done_.load(), total_, progress_seconds(start_), false});
    if (Clock::now() < next_line_) continue;
    next_line_ =
        Clock::now() + (mode_ == ProgressMode::kBar ? Clock::duration(kRedraw) : Clock::duration(kLine));
    draw(false);
  }
}

std::string Progress::line(double seconds, std::uint64_t done) const {
  const double rate = seconds > 0 ? static_cast<double>(done - std::min(done, before_)) / seconds : 0.0;
  std::string text = fmt::format("[{}/{}] {:<10} ", index_ + 1, count_, name_);
  if (total_ > 0) {
    const double share = std::min(1.0, static_cast<double>(done) / static_cast<double>(total_));
    if (mode_ == ProgressMode::kBar) {
      const auto full = static_cast<std::size_t>(share * static_cast<double>(kBarWidth));
      text += "|" + std::string(full, '#') + std::string(kBarWidth - full, ' ') + "| ";
    }
    text += fmt::format("{:3.0f} %  {} of {} {}", share * 100.0, short_count(static_cast<double>(done)),
                        short_count(static_cast<double>(total_)), unit_);
  } else {
    text += fmt::format("{} {}", short_count(static_cast<double>(done)), unit_);
  }
  return text + fmt::format("  {}/s", short_count(rate));
}

/// \pre the lock is held
void Progress::draw(bool last) {
  if (mode_ == ProgressMode::kNone) return;
  const double seconds = progress_seconds(start_);
  const std::uint64_t done = done_.load();
  const std::uint64_t fresh = done - std::min(done, before_);
  const double rate = seconds > 0 ? static_cast<double>(fresh) / seconds : 0.0;
  const double eta = rate > 0 && total_ > done ? static_cast<double>(total_ - done) / rate : 0.0;
  const std::uint64_t peak = peak_resident_bytes();
  if (mode_ == ProgressMode::kJson) {
    const Json j = {{"event", last ? "stage_end" : "progress"},
                    {"stage", name_},
                    {"stage_index", index_},
                    {"stages", count_},
                    {"unit", unit_},
                    {"done", done},
                    {"total", total_},
                    {"seconds", seconds},
                    {"rate_per_s", rate},
                    {"eta_s", last ? 0.0 : eta},
                    {"peak_bytes", peak}};
    sink_.write(dump_json(j) + "\n");
    return;
  }
  std::string text = line(seconds, done);
  text += last ? fmt::format("  in {:.1f} s", seconds) : eta > 0 ? "  " + short_time(eta) + " left" : "";
  text += "  peak " + format_bytes(peak);
  if (mode_ == ProgressMode::kBar) text = "\r\x1b[K" + text;
  sink_.write(text + (last || mode_ == ProgressMode::kPlain ? "\n" : ""));
}

}  // namespace tessera

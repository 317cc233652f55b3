#include "stream/stages/coverage/coverage_stage.h"

#include <algorithm>
#include <cmath>
#include <optional>
#include <string>
#include <vector>

#include "kernels/coverage/column_marks.h"
#include "kernels/coverage/near_samples.h"
#include "stream/files/direct_file.h"
#include "stream/files/external_sort.h"
#include "stream/files/json.h"
#include "stream/files/record_file.h"
#include "stream/files/task_files.h"
#include "stream/points/plan.h"
#include "stream/points/reconstruct_options.h"
#include "stream/render/png_file.h"
#include "stream/stages/coverage/missing_picture.h"
#include "stream/stages/coverage/seen_stages.h"

namespace tessera {
namespace {

constexpr std::uint64_t kCoverageFixedBytes = std::uint64_t{10} << 20;  ///< the sample, and columns of a task
constexpr std::uint64_t kCoverageSortBytes = std::uint64_t{4} << 20;
constexpr std::size_t kCoverageBuffer = std::size_t{1} << 18;
constexpr std::size_t kCoveragePage = 4096;              ///< records read at a time
constexpr std::size_t kColumnsBeforeCombined = 1 << 17;  ///< blocks

std::string near_part(std::size_t task) {
  return "coverage/" + task_file_stem(task) + ".near";
}
std::string covered_part(std::size_t task) {
  return "coverage/" + task_file_stem(task) + ".columns";
}

std::vector<Int3> load_sample(const std::filesystem::path& work) {
  std::vector<Int3> sample;
  const bool ground = std::filesystem::exists(work / kSeenGroundFile);
  for_each_page<Int3>(work / (ground ? kSeenGroundFile : kSeenSampleFile), kCoveragePage,
                      [&](std::span<const Int3> q) { sample.insert(sample.end(), q.begin(), q.end()); });
  return sample;
}

/// The points of the sample by brick.
class SampleBricks {
 public:
  explicit SampleBricks(std::span<const Int3> sample) {
    constexpr int kShift = kBrickBits + kQuantumBits;
    for (const Int3& q : sample) {
      const Int3 at = {q[0] >> kShift, q[1] >> kShift, q[2] >> kShift};
      if (bricks_.empty() || bricks_.back().at != at)
        bricks_.push_back({brick_key(at), at, static_cast<std::uint32_t>(position_.size()), 0});
      ++bricks_.back().count;
      Double3 p{};
      for (std::size_t a = 0; a < 3; ++a) p[a] = q[a] * (1.0 / kQuantaPerCell);
      position_.push_back(p);
    }
  }
  const std::vector<Double3>& positions() const { return position_; }

  /// use(index) for every point in bricks that the box touches.
  template <class Use>
  void for_box(const Double3& low, const Double3& high, const Use& use) const {
    Int3 first{}, last{};
    double bricks = 1.0;
    for (std::size_t a = 0; a < 3; ++a) {
      const auto brick = [](double x) {
        return static_cast<std::int32_t>(
            std::floor(std::clamp(x, 0.0, double{1 << kMaxCellBits}) / kBrickCells));
      };
      first[a] = brick(low[a]), last[a] = brick(high[a]);
      bricks *= last[a] - first[a] + 1.0;
    }
    const auto of = [&](const Brick& b) {
      for (std::uint32_t i = b.first; i < b.first + b.count; ++i) use(i);
    };
    if (bricks > static_cast<double>(bricks_.size())) {
      for (const Brick& b : bricks_) {
        bool inside = true;
        for (std::size_t a = 0; a < 3; ++a) inside = inside && b.at[a] >= first[a] && b.at[a] <= last[a];
        if (inside) of(b);
      }
      return;
    }
    for (std::int32_t k = first[2]; k <= last[2]; ++k)
      for (std::int32_t j = first[1]; j <= last[1]; ++j)
        for (std::int32_t i = first[0]; i <= last[0]; ++i) {
          const std::uint64_t key = brick_key({i, j, k});
          const auto found =
              std::lower_bound(bricks_.begin(), bricks_.end(), key,
                               [](const Brick& b, std::uint64_t wanted) { return b.key < wanted; });
          if (found != bricks_.end() && found->key == key) of(*found);
        }
  }

 private:
  struct Brick {
    std::uint64_t key;
    Int3 at;
    std::uint32_t first, count;
  };
  std::vector<Brick> bricks_;
  std::vector<Double3> position_;
};

class CoverageStage : public Stage {
 public:
  CoverageStage(const JobState& state,
                const std::function<std::unique_ptr<FaceSource>(const JobState&)>& faces)
      : state_(state),
        seen_(SeenScan::of_work(state.work)),
        axes_(ViewAxes::along(reconstruct_options(state).up.value_or(Double3{0, 0, 1}))),
        h_(Plan::of_work(state.work).lattice.h) {
    if (seen_.spacing > 0.0) faces_ = faces(state);
  }

  std::string name() const override { return "coverage"; }
  std::size_t task_count() const override { return faces_ ? faces_->task_count() : 0; }
  std::uint64_t units() const override { return faces_ ? faces_->face_count() : 0; }
  std::string unit_name() const override { return "faces"; }
  std::uint64_t task_bytes(std::size_t task) const override {
    return coverage_task_bytes(faces_->task_bytes(task));
  }

  Json run(std::size_t task, TaskContext& context) const override {
    const SampleBricks sample(load_sample(state_.work));
    std::vector<std::uint64_t> near((sample.positions().size() + 63) / 64, 0);
    std::vector<ColumnMask> columns;
    ColumnCover cover;
    faces_->read(task, [&](const PlacedFaces& part) {
      context.check_stop();
      mark_near(part, sample, near);
      cover_columns(part, cover, columns);
      context.advance(part.faces.size());
    });
    cover.flush(columns);
    combine_columns(columns);
    DirectFile near_file(context.create(near_part(task)), kCoverageBuffer);
    near_file.write(near.data(), near.size() * sizeof(near[0]));
    DirectFile column_file(context.create(covered_part(task)), kCoverageBuffer);
    column_file.write(columns.data(), columns.size() * sizeof(ColumnMask));
    context.count_written(near_file.finish() + column_file.finish());
    return nullptr;
  }

  std::uint64_t finish_bytes() const override { return coverage_finish_bytes(); }

  Json finish(const std::vector<Json>& summaries, TaskContext& context) const override {
    if (!faces_) return {{"measured", false}};
    const std::vector<Int3> sample = load_sample(state_.work);
    const std::vector<std::uint64_t> near = join_near(summaries.size(), sample.size());
    std::optional<MissingPicture> picture = empty_picture();
    std::uint64_t points_missing = 0;
    for (std::size_t i = 0; i < sample.size(); ++i) {
      const bool missing = (near[i / 64] >> i % 64 & 1u) == 0;
      points_missing += missing;
      if (missing && picture) picture->add(column(sample[i][axes_.u]), column(sample[i][axes_.v]), true);
    }
    std::uint64_t columns = 0, columns_missing = 0;
    compare_columns(summaries.size(), context, [&](std::uint32_t u, std::uint32_t v, bool missing) {
      ++columns;
      columns_missing += missing;
      picture->add(u, v, missing);
    });
    const std::filesystem::path path = missing_picture_path(state_.output);
    const bool drawn = picture && points_missing + columns_missing > 0;
    if (drawn) {
      write_png(path, picture->image());
    } else {
      std::filesystem::remove(path);  // that of an earlier run is not of this output
    }
    const auto share = [](std::uint64_t missing, std::uint64_t all) {
      return all > 0 ? Json(1.0 - static_cast<double>(missing) / static_cast<double>(all)) : Json();
    };
    return {{"measured", true},
            {"plan", share(columns_missing, columns)},
            {"columns", columns},
            {"columns_missing", columns_missing},
            {"column_edge", seen_.column_edge * h_ / kQuantaPerCell},
            {"confirmed", share(points_missing, sample.size())},
            {"points", sample.size()},
            {"points_missing", points_missing},
            {"distance", seen_.near_distance() * h_},
            {"spacing", seen_.spacing * h_},
            {"one_in", seen_.stride},
            {"picture", drawn}};
  }

  std::vector<std::string> obsolete() const override { return {"coverage/", "seen/"}; }

 private:
  std::uint32_t column(std::int32_t quanta) const {
    return static_cast<std::uint32_t>(quanta / seen_.column_edge);
  }

  void mark_near(const PlacedFaces& part, const SampleBricks& sample,
                 std::vector<std::uint64_t>& near) const {
    if (part.faces.empty()) return;
    Double3 low = part.position.front(), high = low;
    for (const Double3& p : part.position)
      for (std::size_t a = 0; a < 3; ++a) low[a] = std::min(low[a], p[a]), high[a] = std::max(high[a], p[a]);
    const double distance = seen_.near_distance();
    for (std::size_t a = 0; a < 3; ++a) low[a] -= distance, high[a] += distance;
    std::vector<std::uint32_t> index;
    std::vector<Double3> open;  // points of the sample around here that no face has come near yet
    sample.for_box(low, high, [&](std::uint32_t i) {
      const Double3& p = sample.positions()[i];
      bool inside = (near[i / 64] >> i % 64 & 1u) == 0;
      for (std::size_t a = 0; a < 3; ++a) inside = inside && p[a] >= low[a] && p[a] <= high[a];
      if (!inside) return;
      index.push_back(i);
      open.push_back(p);
    });
    if (open.empty()) return;
    NearSamples samples(open, distance);
    samples.add(part.position, part.faces);
    for (std::size_t i = 0; i < index.size(); ++i)
      near[index[i] / 64] |= std::uint64_t{samples.near()[i]} << index[i] % 64;
  }

  void cover_columns(const PlacedFaces& part, ColumnCover& cover, std::vector<ColumnMask>& columns) const {
    const double per_cell = static_cast<double>(kQuantaPerCell) / seen_.column_edge;
    std::vector<ColumnCover::Corner> corner(part.position.size());
    for (std::size_t v = 0; v < corner.size(); ++v)
      corner[v] =
          ColumnCover::corner(part.position[v][axes_.u] * per_cell, part.position[v][axes_.v] * per_cell);
    cover.add(corner, part.faces, columns);
    if (columns.size() > kColumnsBeforeCombined) combine_columns(columns);
  }

  std::vector<std::uint64_t> join_near(std::size_t tasks, std::size_t points) const {
    std::vector<std::uint64_t> near((points + 63) / 64, 0);
    for (std::size_t t = 0; t < tasks; ++t) {
      std::size_t at = 0;
      for_each_page<std::uint64_t>(state_.work / near_part(t), kCoveragePage,
                                   [&](std::span<const std::uint64_t> words) {
                                     for (const std::uint64_t word : words) near.at(at++) |= word;
                                   });
    }
    return near;
  }

  /// Of the columns that the points fill; none without any.
  std::optional<MissingPicture> empty_picture() const {
    std::uint32_t low_u = ~0u, low_v = ~0u, high_u = 0, high_v = 0;
    for_each_page<ColumnMask>(
        state_.work / kSeenColumnsFile, kCoveragePage, [&](std::span<const ColumnMask> blocks) {
          for (const ColumnMask& b : blocks) {
            low_u = std::min(low_u, block_u(b.key)), low_v = std::min(low_v, block_v(b.key));
            high_u = std::max(high_u, block_u(b.key) + kColumnBlock - 1);
            high_v = std::max(high_v, block_v(b.key) + kColumnBlock - 1);
          }
        });
    if (low_u > high_u) return std::nullopt;
    return MissingPicture(low_u, low_v, high_u, high_v);
  }

  /// use(u, v, missing) for every column that was seen.
  template <class Use>
  void compare_columns(std::size_t tasks, TaskContext& context, const Use& use) const {
    const auto less = [](const ColumnMask& a, const ColumnMask& b) {
      return a.key != b.key ? a.key < b.key : a.columns < b.columns;
    };
    ExternalSort<ColumnMask, decltype(less)> sort(state_.work, kCoverageSortBytes, less);
    for (std::size_t t = 0; t < tasks; ++t)
      for_each_page<ColumnMask>(state_.work / covered_part(t), kCoveragePage,
                                [&](std::span<const ColumnMask> blocks) {
                                  context.check_stop();
                                  for (const ColumnMask& block : blocks) sort.add(block);
                                });
    const ReadFile seen(state_.work / kSeenColumnsFile);
    std::vector<ColumnMask> page;
    std::uint64_t at = 0;
    std::size_t next = 0;
    ColumnMask wanted{}, covered{};
    const auto next_wanted = [&] {
      if (next == page.size()) {
        page.resize(std::min<std::uint64_t>(kCoveragePage, (seen.size() - at) / sizeof wanted));
        if (page.empty()) return false;
        seen.read_at(at, page.data(), page.size() * sizeof wanted);
        at += page.size() * sizeof wanted;
        next = 0;
      }
      wanted = page[next++];
      covered = {wanted.key, 0};
      return true;
    };
    const auto hand_out = [&] {
      for (std::uint32_t c = 0; c < 64; ++c)
        if ((wanted.columns >> c & 1u) != 0)
          use(block_u(wanted.key) + c % kColumnBlock, block_v(wanted.key) + c / kColumnBlock,
              (covered.columns >> c & 1u) == 0);
    };
    bool more = next_wanted();
    sort.drain([&](std::span<const ColumnMask> blocks) {
      context.check_stop();
      for (const ColumnMask& block : blocks) {
        while (more && wanted.key < block.key) {
          hand_out();
          more = next_wanted();
        }
        if (more && wanted.key == block.key) merge_columns(covered, block);
      }
    });
    while (more) {
      hand_out();
      more = next_wanted();
    }
  }

  JobState state_;
  SeenScan seen_;
  ViewAxes axes_;
  double h_;
  std::unique_ptr<FaceSource> faces_;  ///< null where nothing is measured
};

}  // namespace

std::uint64_t coverage_task_bytes(std::uint64_t faces_bytes) {
  return faces_bytes + kCoverageFixedBytes;
}

std::uint64_t coverage_finish_bytes() {
  return kCoverageSortBytes + MissingPicture::kBytes + kCoverageFixedBytes;
}

std::unique_ptr<Stage> make_coverage_stage(
    const JobState& state, const std::function<std::unique_ptr<FaceSource>(const JobState&)>& faces) {
  return std::make_unique<CoverageStage>(state, faces);
}

}  // namespace tessera

#include "stream/points/cell_ladder.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <map>
#include <utility>

#include "octree/error.h"
#include "stream/files/durable_file.h"
#include "stream/files/json.h"
#include "stream/runtime/numbers.h"

namespace tessera {
namespace {

constexpr double kBlockEdge = 8.0;

double total(const std::vector<BrickCount>& bricks) {
  double points = 0.0;
  for (const BrickCount& b : bricks) points += static_cast<double>(b.points);
  return points;
}

double median(std::vector<std::uint64_t> values) {
  if (values.empty()) return 0.0;
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return static_cast<double>(*middle);
}

/// Blocks of 8, 16 and 32 cells, bricks of 64, and what these join to.
std::vector<double> block_ladder(const std::vector<BrickCount>& bricks) {
  std::vector<double> occupied(3, 0.0);
  std::vector<BrickCoord> coarser;
  for (const BrickCount& b : bricks) {
    std::array<std::uint64_t, 8> wide{};  // blocks of 16 cells, one bit each
    std::uint64_t widest = 0;             // of 32
    for (std::size_t z = 0; z < 8; ++z)
      for (std::uint64_t bits = b.blocks[z]; bits != 0; bits &= bits - 1) {
        const int at = std::countr_zero(bits), x = at & 7, y = at >> 3;
        occupied[0] += 1.0;
        wide[z / 2] |= std::uint64_t{1} << ((y / 2) << 3 | x / 2);
        widest |= std::uint64_t{1} << ((z / 4) << 2 | static_cast<unsigned>(y / 4) << 1 |
                                       static_cast<unsigned>(x / 4));
      }
    for (const std::uint64_t bits : wide) occupied[1] += std::popcount(bits);
    occupied[2] += std::popcount(widest);
    coarser.push_back(b.brick);
  }
  for (;;) {
    occupied.push_back(static_cast<double>(coarser.size()));
    if (coarser.size() <= 8) return occupied;
    for (BrickCoord& c : coarser)
      for (std::int64_t& i : c) i >>= 1;
    std::sort(coarser.begin(), coarser.end());
    coarser.erase(std::unique(coarser.begin(), coarser.end()), coarser.end());
  }
}

}  // namespace

PointClumps clumps_of_bricks(const std::vector<BrickCount>& bricks) {
  std::vector<std::uint64_t> points;
  for (const BrickCount& b : bricks) points.push_back(b.points);
  return find_clumps(block_ladder(bricks), kBlockEdge, total(bricks), median(std::move(points)));
}

PointClumps clumps_of_samples(const std::vector<CellSampler::Cell>& cells, double size,
                              const std::vector<BrickCount>& bricks) {
  constexpr int kPerAxis = 8;
  double finest = 0.0, middle = 0.0, blocks = 0.0;
  std::vector<std::uint64_t> typical;
  for (const CellSampler::Cell& cell : cells) {
    std::map<std::array<int, 3>, std::uint64_t> cell_points;
    for (const Double3& p : cell.points) {
      std::array<int, 3> at{};
      for (std::size_t a = 0; a < 3; ++a)
        at[a] = static_cast<int>(
            std::clamp(std::floor((p[a] - cell.min[a]) / (size / kPerAxis)), 0.0, kPerAxis - 1.0));
      ++cell_points[at];
    }
    std::map<std::array<int, 3>, std::uint64_t> of_four, of_eight;
    for (const auto& [at, count] : cell_points) {
      of_four[{at[0] / 2, at[1] / 2, at[2] / 2}] += count;
      of_eight[{at[0] / 4, at[1] / 4, at[2] / 4}] += count;
    }
    // A clump may spread over some of the finest cells.
    for (const auto& [at, count] : of_eight) typical.push_back(count);
    finest += static_cast<double>(cell_points.size());
    middle += static_cast<double>(of_four.size());
    blocks += static_cast<double>(of_eight.size());
  }
  if (blocks == 0.0) return clumps_of_bricks(bricks);
  std::vector<double> occupied = block_ladder(bricks);
  const double all = occupied[0] / blocks;
  occupied.insert(occupied.begin(), {finest * all, middle * all});
  return find_clumps(occupied, kBlockEdge / 4, total(bricks), median(std::move(typical)));
}

std::string clump_sentence(const PointClumps& clumps) {
  if (!(clumps.spacing > 0.0)) return {};
  return "the points lie in clumps of about " + number_text(std::round(clumps.points)) + ", " +
         number_text(round_up_2_digits(clumps.spacing)) +
         " from one to the next, as where one scan is there several times: leave out the copies, or give "
         "--thin " +
         number_text(round_up_2_digits(clumps.spacing / 2)) + ", or --resolution " +
         number_text(round_up_2_digits(1.5 * clumps.spacing));
}

void save_clumps(const std::filesystem::path& path, const PointClumps& clumps) {
  write_text(path, dump_json(Json{{"spacing", clumps.spacing}, {"points", clumps.points}}));
}

std::string clump_sentence(const std::filesystem::path& work) {
  if (!std::filesystem::exists(work / kClumpFile)) return {};
  const auto j = try_parse_json(read_text(work / kClumpFile));
  return j.is_object() ? clump_sentence(PointClumps{j.value("spacing", 0.0), j.value("points", 0.0)}) : "";
}

BrickWindow scan_window(const std::vector<BrickCount>& bricks, double h, bool measured) {
  try {
    return robust_window(bricks, h);
  } catch (const InputError&) {
    PointClumps clumps = clumps_of_bricks(bricks);
    clumps.spacing *= h;
    if (!measured || !(clumps.spacing > 0.0)) throw;
    throw InputError(clump_sentence(clumps));
  }
}

}  // namespace tessera

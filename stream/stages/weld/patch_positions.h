/// \file patch_positions.h
/// Where the vertices of welded patches lie: as extraction left them, moved by the passes "border", "blunt" and "holes", taken back by the rounds of
/// the pass "uncross".
#pragma once
#include <cstdint>
#include <filesystem>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "stream/meshes/patch_store.h"
#include "stream/stages/weld/border_moves.h"

namespace tessera {

/// Rounds of the pass "uncross"; the last one only looks. What goes back may meet the next moved vertex: in 25 M faces of a plant a
/// chain of four went back one by one. Rounds behind one in which nothing did are idle.
inline constexpr int kUncrossRounds = 8;

/// In place of a number of rounds: before the pass "blunt".
inline constexpr int kBeforeBlunt = -1;

/// A vertex of a patch as one number, ascending by patch.
constexpr std::uint64_t patch_vertex(std::size_t patch, std::uint32_t vertex) {
  return std::uint64_t{patch} << 32 | vertex;
}

/// Of one task of a round: the vertices that it takes back, of any patch.
std::string returned_file_name(int round, std::size_t task);
/// \returns bytes written
std::uint64_t save_returned(const std::filesystem::path& path, std::vector<std::uint64_t> vertices);

/// Whether any vertex went back in a round. \param round  from 0
bool any_returned(const std::filesystem::path& work, int round);

class PatchPositions {
 public:
  /// \param rounds  of the pass "uncross" that count, those of them that there are; or kBeforeBlunt. All of them: what
  ///                "holes" moved counts too
  PatchPositions(const std::filesystem::path& work, const PatchStore& store, int rounds = kUncrossRounds);

  /// Own vertices. \param position  cells, relative to the brick
  /// \param safe  where each may go back to, its position where it may not; may be null
  void load(std::size_t patch, std::vector<Float3>& position, std::vector<std::uint32_t>& rgba,
            std::vector<Float3>* safe = nullptr) const;
  /// false: surely none of its vertices may go back.
  bool may_return(std::size_t patch) const;
  /// Own vertices that went back in a round, as patch_vertex(), ascending. \param round  from 0
  std::span<const std::uint64_t> returned(std::size_t patch, int round) const;

 private:
  const PatchStore& store_;
  BorderMoves moves_;
  std::optional<BorderMoves> blunt_, rims_;
  std::vector<std::vector<std::uint64_t>> rounds_;
};

}  // namespace tessera

/// \file sign_solver.h
/// Signs of many patches from the votes between them: pairs that agree most are joined first and their votes
/// added up, so that many weak ties speak with one voice; then whole joined groups are flipped where that
/// helps. Sources: Schertler, Savchynskyy, Gumhold, "Towards Globally Optimal Normal Orientations for Large
/// Point Clouds", 2017 (reduced graph of patches); Jakob, Buchenau, Guthe, "Parallel Globally Consistent
/// Normal Orientation of Raw Unorganized Point Clouds", 2019 (edge collapse that adds up parallel edges).
#pragma once
#include <cstdint>
#include <span>
#include <vector>

namespace tessera {

/// The votes between two patches. Their sign is relative to how the patches' normals happen to point.
struct PatchVote {
  std::uint32_t a = 0;
  std::uint32_t b = 0;
  std::int64_t same = 0;      ///< summed weight of links that say "same side"
  std::int64_t opposite = 0;  ///< and of those that say "opposite"
};

/// Ascending by (a, b), repeats added up.
void merge_votes(std::vector<PatchVote>& votes);

/// Decides nodes one after the other, lowest first: those for whose signs votes of decided ones speak, three to one and whatever
/// the open ones turn out to be.
/// \param votes  between nodes in their signs: `same` is kept, `opposite` broken; ends behind the nodes stay open
/// \param decided  per node, not 0 where known
/// \cost O(V + E) a node asked; one is asked again when a neighbour is decided
void decide_told(std::span<const PatchVote> votes, std::vector<std::uint8_t>& decided);

struct ContractionLimits {
  double min_score = 0.0;       ///< pairs below join no more; score = (same - opposite)^2 / (same + opposite)
  double min_confidence = 0.0;  ///< nor do those below in |same - opposite| / (same + opposite)
};

/// A pair of groups that joined, by the nodes that stood for them.
struct SignJoin {
  std::uint32_t a = 0;
  std::uint32_t b = 0;
  float confidence = 0.0f;  ///< |same - opposite| / (same + opposite) then
  std::int8_t sign = 1;     ///< for which most votes spoke
};

/// How groups joined: a forest. A node joins its parent's group in its round, all that hangs below it joined
/// before.
struct Contraction {
  std::vector<std::uint32_t> parent;  ///< itself for the last of a group
  std::vector<std::int8_t> relation;  ///< sign relative to the parent
  std::vector<std::uint32_t> round;   ///< rises towards the root, roots: the largest value
  std::vector<SignJoin> joins;        ///< by round; where several joined at once, not with the parent alone
  std::vector<std::uint32_t> joined_last;  ///< all nodes by descending round: parents before their children
};

/// Joins the pairs with the best score, round by round: in a round every group that has a tie within a fixed
/// factor of the best joins along its best tie. Heavier groups take lighter ones in. Deterministic, ties by
/// index.
/// \param weight  of the nodes, decides who takes whom in
/// \pre votes are merged, a < b
/// \cost O(E log E) per round, rounds grow with log(nodes) and log(range of votes)
[[nodiscard]] Contraction contract_signs(std::span<const std::uint64_t> weight, std::vector<PatchVote> votes,
                                         const ContractionLimits& limits);

struct SignSolution {
  std::vector<std::int8_t> sign;  ///< per patch, +1 or -1; +1 for the root of its component
  std::vector<std::uint32_t>
      component;  ///< per patch, the nearest anchor that it hangs on, or the root of its component
  std::vector<std::uint8_t>
      uncertain;  ///< per patch: split votes join it to that, and what is decided does not clearly speak for its sign
  std::uint64_t frustrated_votes = 0;  ///< weight of votes that the solution breaks
  std::uint64_t total_votes = 0;
};

/// Signs that break few votes: contraction to the end, then flips of whole subtrees of the contraction,
/// largest gain first, and of single nodes, while they gain, a fixed number of sweeps.
/// \param anchors  per patch, those whose signs are decided elsewhere, where more votes are known: the others hang on them;
///     empty = none
/// \pre votes are merged, a < b, every index below weight.size()
[[nodiscard]] SignSolution solve_signs(std::span<const std::uint64_t> weight,
                                       std::span<const PatchVote> votes,
                                       std::span<const std::uint8_t> anchors = {});

}  // namespace tessera

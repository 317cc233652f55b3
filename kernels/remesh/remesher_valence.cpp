// Dislocations, vertices of five faces beside vertices of seven, glide by flips that leave the sum of squares of valences
// as it is until they meet others: the drifting edges of Surazhsky and Gotsman, "Explicit Surface Remeshing", 2003. Flips
// that lower the sum at once leave a quarter of the vertices irregular, and relaxation evens out nothing around these.
#include <algorithm>
#include <array>
#include <cmath>

#include "kernels/mesh/mean_ratio.h"
#include "kernels/remesh/remesher.h"

namespace tessera {
namespace {

constexpr std::size_t kMostSteps = 8;
constexpr double kMinRoundness = 0.35;  ///< of these; 0.6 in a regular lattice
/// Cosine of what they may turn from one to the other, 15 degrees: where edges are long beside the surface's curvature a flip
/// that relaxation does not undo takes more of the shape than a regular vertex is worth.
constexpr double kMinCosineAcross = 0.966;

}  // namespace

/// Whether six faces suit the vertex, and flips may give it others.
bool Remesher::wants_six(std::uint32_t v) const {
  constexpr unsigned kNot = kVertexLocked | kVertexFixed | kVertexDead | kVertexOpen;
  return (mesh_.state(v) & kNot) == 0 && !info_[v].line && !info_[v].pinned;
}

/// \param most_steps  at most kMostSteps; each leaves two flat faces behind, of which relaxation undoes few and not more
void Remesher::glide_all(std::size_t most_steps, RemeshReport& report) {
  count_valences();
  begin_guarding();
  for (std::uint32_t f = 0; f < mesh_.faces().size(); ++f) {
    step();
    if (mesh_.face(f).state & kStateDead) continue;
    for (std::uint32_t c = 4 * f; c < 4 * f + 3; ++c)
      for (const bool forward : {true, false}) glide(c, forward, most_steps, report);
  }
}

/// Of five faces at the vertex of the corner and seven at the next or the previous one: flips along the strip of faces that
/// begins there, if within some steps they come to where the sum of squares falls.
void Remesher::glide(std::uint32_t c, bool forward, std::size_t most_steps, RemeshReport& report) {
  const auto ahead = [&](std::uint32_t corner) {
    return forward ? next_corner(corner) : prev_corner(corner);
  };
  const auto back = [&](std::uint32_t corner) { return forward ? prev_corner(corner) : next_corner(corner); };
  const std::uint32_t five = mesh_.vertex(c), seven = mesh_.vertex(ahead(c));
  if (valence_[five] != 5 || valence_[seven] != 7 || !wants_six(five) || !wants_six(seven)) return;
  std::array<std::uint32_t, kMostSteps> flips{};  // the corners across from the edges
  std::array<std::uint32_t, 2 * kMostSteps> strip{};
  std::size_t steps = 0;
  for (bool meets = false; !meets; ++steps) {
    if (steps == most_steps) return;
    const std::uint32_t d = mesh_.opposite(c);
    if (d == kNoCorner || is_line(c)) return;
    const auto end = strip.begin() + static_cast<std::ptrdiff_t>(2 * steps);
    for (const std::uint32_t face : {c >> 2, d >> 2})
      if (std::find(strip.begin(), end, face) != end) return;  // around a tube
    strip[2 * steps] = c >> 2, strip[2 * steps + 1] = d >> 2;
    flips[steps] = c;
    // The flip takes a face from the seven's vertex and from the one behind, and gives one to the five's and the one across.
    const std::uint32_t u = mesh_.vertex(c), a = mesh_.vertex(ahead(c)), b = mesh_.vertex(back(c)),
                        w = mesh_.vertex(d);
    if (!wants_six(b) || !wants_six(w) || valence_[w] > valence_[b]) return;
    const Double3 &pu = mesh_.at(u), &pa = mesh_.at(a), &pb = mesh_.at(b), &pw = mesh_.at(w);
    if (std::min(mean_ratio(pu, pa, pw), mean_ratio(pw, pb, pu)) < kMinRoundness) return;
    const Double3 one = triangle_normal(pu, pa, pw), other = triangle_normal(pw, pb, pu);
    if (std::fabs(dot(one, other)) < kMinCosineAcross * norm(one) * norm(other)) return;
    meets = valence_[w] < valence_[b];
    if (meets) continue;
    const std::uint32_t side = back(d), beyond = mesh_.opposite(side);
    if (beyond == kNoCorner || is_line(side)) return;
    c = ahead(beyond);
  }
  for (std::size_t i = 0; i < steps; ++i) {
    const Refusal refusal = flip_if_sound(flips[i]);
    count(refusal, report);
    if (refusal != Refusal::kNone) return;  // the sum is as it was
    ++report.flips;
  }
}

}  // namespace tessera

#include "kernels/boolean/settle_rounding.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "kernels/mesh/face_boxes.h"
#include "kernels/mesh/face_contact.h"
#include "kernels/mesh/orientation_sign.h"
#include "octree/lists.h"

namespace tessera {
namespace {

using Corners = std::array<std::uint32_t, 3>;

/// Whether a side of one face, seen along an axis, has all of the other beyond it but for what they share: then that is all in
/// which they meet. Pieces of one face lie so, and would cost the exact signs of points that lie in a plane but for rounding.
class FlatSides {
 public:
  FlatSides(const ContactFace& face, std::size_t axis) : face_(face), u_((axis + 1) % 3), v_((axis + 2) % 3) {
    turn_ = orient2d_sign(flat(face.corner[0]), flat(face.corner[1]), flat(face.corner[2]));
  }
  bool has_beyond(const ContactFace& other) const {
    if (turn_ == 0) return false;
    for (std::size_t k = 0; k < 3; ++k) {
      const Double2 from = flat(face_.corner[k]), to = flat(face_.corner[(k + 1) % 3]);
      bool beyond = true;
      for (std::size_t i = 0; i < 3 && beyond; ++i) {
        const std::uint64_t v = other.vertex[i];
        beyond = v == face_.vertex[k] || v == face_.vertex[(k + 1) % 3] ||
                 orient2d_sign(from, to, flat(other.corner[i])) == -turn_;
      }
      if (beyond) return true;
    }
    return false;
  }

 private:
  Double2 flat(const Double3& p) const { return {p[u_], p[v_]}; }
  const ContactFace& face_;
  const std::size_t u_, v_;
  int turn_ = 0;
};

std::size_t flattest_axis(const ContactFace& f) {
  const Double3 n = cross(f.corner[1] - f.corner[0], f.corner[2] - f.corner[0]);
  std::size_t axis = 0;
  for (std::size_t k = 1; k < 3; ++k)
    if (std::fabs(n[k]) > std::fabs(n[axis])) axis = k;
  return axis;
}

class RoundingWork {
 public:
  RoundingWork(SolidMesh& mesh, const std::vector<std::uint8_t>& made, PositionStep step)
      : mesh_(mesh),
        made_(made),
        step_(step),
        star_(make_lists<std::uint32_t>(made.size(), [&](const auto& put) {
          for (std::uint32_t f = 0; f < mesh.faces.size(); ++f)
            for (const std::uint32_t v : mesh.faces[f])
              if (made[v]) put(v, f);
        })) {
    if (step == PositionStep::kFloat)
      for (std::size_t v = 0; v < made.size(); ++v)
        if (made[v]) mesh.points[v] = on_step(mesh.points[v]);
    constexpr double kFar = std::numeric_limits<double>::infinity();
    Double3 low = {kFar, kFar, kFar}, high = {-kFar, -kFar, -kFar};
    for (const Double3& p : mesh.points)
      for (std::size_t k = 0; k < 3; ++k) low[k] = std::min(low[k], p[k]), high[k] = std::max(high[k], p[k]);
    boxes_ = FaceBoxes(low, high);
    std::vector<FaceBoxes::Box> boxes;
    boxes.reserve(mesh.faces.size());
    for (std::uint32_t f = 0; f < mesh.faces.size(); ++f) boxes.push_back(box(f));
    boxes_.build(boxes, FaceBoxes::Order::kMorton);
    rounded_ = mesh.points;
  }

  RoundingStats run() {
    RoundingStats out;
    std::vector<std::uint32_t> bad;
    for (std::uint32_t f = 0; f < mesh_.faces.size(); ++f)
      if (on_cut(f) && trouble(f) > 0) bad.push_back(f);
    out.met = bad.size();
    const int rounds = step_ == PositionStep::kFloat ? 8 : 24;
    for (int round = 0; round < rounds && !bad.empty(); ++round) {
      std::vector<std::uint32_t> movable;
      for (const std::uint32_t f : bad) collect(f, movable);
      std::sort(movable.begin(), movable.end());
      movable.erase(std::unique(movable.begin(), movable.end()), movable.end());
      for (const std::uint32_t v : movable) settle(v, round);
      bad = still_bad(movable, bad);
    }
    for (std::size_t v = 0; v < made_.size(); ++v)
      if (mesh_.points[v] != rounded_[v]) {
        ++out.moved;
        out.farthest = std::max(out.farthest, norm(mesh_.points[v] - rounded_[v]));
      }
    out.left = bad.size();
    if (!bad.empty()) out.where = mesh_.points[mesh_.faces[bad[0]][0]];
    return out;
  }

 private:
  bool on_cut(std::uint32_t f) const {
    const Corners& c = mesh_.faces[f];
    return made_[c[0]] || made_[c[1]] || made_[c[2]];
  }
  std::array<Double3, 3> corners(std::uint32_t f) const {
    const Corners& c = mesh_.faces[f];
    return {mesh_.points[c[0]], mesh_.points[c[1]], mesh_.points[c[2]]};
  }
  FaceBoxes::Box box(std::uint32_t f) const { return boxes_.box(corners(f)); }
  bool has_area(std::uint32_t f) const {
    const auto c = corners(f);
    return !collinear(c[0], c[1], c[2]);
  }
  ContactFace contact_of(std::uint32_t f) const {
    const Corners& c = mesh_.faces[f];
    return {corners(f), {c[0], c[1], c[2]}};
  }
  Double3 on_step(const Double3& p) const {
    if (step_ == PositionStep::kDouble) return p;
    Double3 out;
    for (std::size_t k = 0; k < 3; ++k) out[k] = static_cast<double>(static_cast<float>(p[k]));
    return out;
  }

  /// Faces that the face meets, and much where it has no area. Those that lie where the input had them touch where a solid touches
  /// itself: two vertices at one position are no trouble that another position would mend.
  std::size_t trouble(std::uint32_t f) const {
    constexpr std::size_t kFlat = 100;
    if (!has_area(f)) return kFlat;
    std::size_t sum = 0;
    const ContactFace here = contact_of(f);
    const std::size_t axis = flattest_axis(here);
    const FlatSides sides(here, axis);
    boxes_.for_meeting(box(f), [&](std::uint32_t g) {
      if (g == f) return true;
      const ContactFace there = contact_of(g);
      if (sides.has_beyond(there) || FlatSides(there, axis).has_beyond(here) || !has_area(g)) return true;
      const FaceContact contact = face_contact(here, there);
      if (contact == FaceContact::kTouch && twins(f, g)) return true;
      sum += contact != FaceContact::kNone;
      return true;
    });
    return sum;
  }
  /// Whether two corners of them are one point that was split.
  bool twins(std::uint32_t f, std::uint32_t g) const {
    for (const std::uint32_t v : mesh_.faces[f])
      for (const std::uint32_t w : mesh_.faces[g])
        if (v != w && mesh_.points[v] == mesh_.points[w]) return true;
    return false;
  }

  void collect(std::uint32_t f, std::vector<std::uint32_t>& movable) const {
    const auto add = [&](std::uint32_t g) {
      for (const std::uint32_t v : mesh_.faces[g])
        if (made_[v]) movable.push_back(v);
    };
    add(f);
    if (!has_area(f)) return;
    const ContactFace here = contact_of(f);
    boxes_.for_meeting(box(f), [&](std::uint32_t g) {
      if (g != f && has_area(g) && face_contact(here, contact_of(g)) != FaceContact::kNone) add(g);
      return true;
    });
  }

  std::size_t trouble_around(std::uint32_t v) const {
    std::size_t sum = 0;
    for (const std::uint32_t f : star_[v]) sum += trouble(f);
    return sum;
  }

  void put(std::uint32_t v, const Double3& p) {
    mesh_.points[v] = p;
    for (const std::uint32_t f : star_[v]) boxes_.set(f, box(f));
  }

  /// Tries the positions around the vertex, a step of the round away.
  void settle(std::uint32_t v, int round) {
    std::size_t best = trouble_around(v);
    if (best == 0) return;
    const Double3 from = rounded_[v];
    Double3 best_at = mesh_.points[v];
    double size = 0.0;
    for (const double x : from) size = std::max(size, std::fabs(x));
    const int bits = step_ == PositionStep::kFloat ? 23 : 52;
    const double step = std::ldexp(1.0, (size > 0.0 ? std::ilogb(size) : 0) - bits + round);
    for (int code = 0; code < 27 && best > 0; ++code) {
      if (code == 13) continue;
      const std::array<int, 3> steps = {code % 3 - 1, code / 3 % 3 - 1, code / 9 - 1};
      const Double3 p =
          on_step({from[0] + steps[0] * step, from[1] + steps[1] * step, from[2] + steps[2] * step});
      put(v, p);
      const std::size_t now = trouble_around(v);
      if (now < best) best = now, best_at = p;
    }
    put(v, best_at);
  }

  std::vector<std::uint32_t> still_bad(const std::vector<std::uint32_t>& moved,
                                       const std::vector<std::uint32_t>& before) const {
    std::vector<std::uint32_t> faces = before, out;
    for (const std::uint32_t v : moved) faces.insert(faces.end(), star_[v].begin(), star_[v].end());
    std::sort(faces.begin(), faces.end());
    faces.erase(std::unique(faces.begin(), faces.end()), faces.end());
    for (const std::uint32_t f : faces)
      if (trouble(f) > 0) out.push_back(f);
    return out;
  }

  SolidMesh& mesh_;
  const std::vector<std::uint8_t>& made_;
  const PositionStep step_;
  const Lists<std::uint32_t> star_;
  FaceBoxes boxes_;
  std::vector<Double3> rounded_;
};

}  // namespace

RoundingStats settle_rounding(BooleanResult& result, PositionStep step) {
  return RoundingWork(result.mesh, result.made, step).run();
}

}  // namespace tessera

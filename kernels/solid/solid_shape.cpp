#include "kernels/solid/solid_shape.h"

#include <algorithm>
#include <bitset>
#include <cmath>

#include "kernels/solid/sign_change.h"

namespace tessera {
namespace {

constexpr double kRootCells = 1e-9;  ///< how exact it is
constexpr std::uint32_t kCrossingsPerLeaf = 256;
constexpr double kNearSurface = 2.0;  ///< cells: the ends of edges that cross it are nearer

/// Value and direction of the part of a shape that decides.
struct Part {
  double value = 0.0;
  Double3 direction = {0, 0, 0};
};
Part larger(const Part& a, const Part& b) {
  return b.value > a.value ? b : a;
}

Double3 three(const std::vector<double>& n, std::size_t at) {
  return {n[at], n[at + 1], n[at + 2]};
}

/// Between two parallel planes.
Part slab(const Double3& p, const Double3& middle, const Double3& axis, double half) {
  const double along = dot(p - middle, axis);
  return {std::fabs(along) - half, along < 0.0 ? -axis : axis};
}

/// Of a foot on the surface, seen from a point outside.
Part beyond(const Double3& p, const Double3& foot) {
  return {norm(p - foot), p - foot};
}

struct Sphere {
  Double3 centre;
  double radius;
  Part at(const Double3& p) const { return {norm(p - centre) - radius, p - centre}; }
  Double3 middle() const { return centre; }
  Double3 half_size() const { return {radius, radius, radius}; }
};

struct Box {
  Double3 centre, half;
  Part at(const Double3& p) const {
    return larger(larger(slab(p, centre, {1, 0, 0}, half[0]), slab(p, centre, {0, 1, 0}, half[1])),
                  slab(p, centre, {0, 0, 1}, half[2]));
  }
  Part distance(const Double3& p) const {
    const Part face = at(p);
    if (!(face.value > 0.0)) return face;
    Double3 foot;
    for (std::size_t a = 0; a < 3; ++a) foot[a] = std::clamp(p[a], centre[a] - half[a], centre[a] + half[a]);
    return beyond(p, foot);
  }
  Double3 middle() const { return centre; }
  Double3 half_size() const { return half; }
};

/// Cylinder and cone: the distance from the axis is compared with a radius that is linear along it.
struct Cone {
  Double3 centre, axis;
  double half, radius, slope;  ///< radius in the middle, its change per length
  Part at(const Double3& p) const {
    const Double3 from = p - centre;
    const double along = dot(from, axis);
    const Double3 out = from - axis * along;
    const double across = norm(out), tilt = 1.0 / std::sqrt(1.0 + slope * slope);
    const Double3 direction = across > 0.0 ? out / across : any_orthogonal(axis);
    return larger({(across - radius - slope * along) * tilt, direction - axis * slope},
                  slab(p, centre, axis, half));
  }
  Part distance(const Double3& p) const {
    const Part face = at(p);
    if (!(face.value > 0.0)) return face;
    // In the half-plane through the axis and the point: the nearest of the two ends and the side.
    const Double3 from = p - centre;
    const double along = dot(from, axis);
    const Double3 out = from - axis * along;
    const double across = norm(out);
    const Double3 direction = across > 0.0 ? out / across : any_orthogonal(axis);
    const auto foot = [&](double a, double r) { return centre + axis * a + direction * r; };
    const double low = radius - slope * half, high = radius + slope * half;
    const double tilt = 1.0 + slope * slope;
    const double on = std::clamp((along + slope * (across - radius)) / tilt, -half, half);
    Part best = beyond(p, foot(on, radius + slope * on));
    for (const Part& end :
         {beyond(p, foot(half, std::min(across, high))), beyond(p, foot(-half, std::min(across, low)))})
      if (end.value < best.value) best = end;
    return best;
  }
  Double3 middle() const { return centre; }
  Double3 half_size() const {
    const double maximum = std::max(radius + slope * half, radius - slope * half);
    Double3 r;
    for (std::size_t a = 0; a < 3; ++a) r[a] = std::fabs(axis[a]) * half + maximum;
    return r;
  }
};

struct Torus {
  Double3 centre, axis;
  double ring, tube;
  Part at(const Double3& p) const {
    const Double3 from = p - centre;
    const double along = dot(from, axis);
    const Double3 out = from - axis * along;
    const double across = norm(out);
    const Double3 direction = across > 0.0 ? out / across : any_orthogonal(axis);
    const Double3 foot = direction * (across - ring) + axis * along;
    return {norm(foot) - tube, foot};
  }
  Double3 middle() const { return centre; }
  Double3 half_size() const { return {ring + tube, ring + tube, ring + tube}; }
};

struct HalfSpace {
  Double3 point, normal;
  Part at(const Double3& p) const { return {dot(p - point, normal), normal}; }
};

template <class Form>
class Placed : public SolidShape {
 public:
  Placed(const Form& form, const Placement& placement)
      : form_(form), placement_(placement), inverse_(placement.inverse()) {
    double squares = 0.0;
    for (const double m : inverse_.matrix) squares += m * m;
    // A local length is at most the norm of the inverse times the length in the world; a rotation's is 1.
    const Placement both = {
        {inverse_.matrix[0], inverse_.matrix[3], inverse_.matrix[6], inverse_.matrix[1], inverse_.matrix[4],
         inverse_.matrix[7], inverse_.matrix[2], inverse_.matrix[5], inverse_.matrix[8]},
        {0, 0, 0}};
    const auto square = both.after(inverse_).matrix;
    double off = 0.0;
    for (std::size_t k = 0; k < 9; ++k)
      off = std::max(off, std::fabs(square[k] - (k % 4 == 0 ? square[0] : 0.0)));
    const bool similar = off < 1e-12 * square[0];
    per_length_ = 1.0 / std::sqrt(similar ? square[0] * (1.0 + 1e-12) : squares);
  }
  double value(const Double3& p) const override { return form_.at(inverse_.apply(p)).value * per_length_; }
  Double3 direction(const Double3& p) const override {
    const Double3 d = form_.at(inverse_.apply(p)).direction;
    const auto& m = inverse_.matrix;
    return {m[0] * d[0] + m[3] * d[1] + m[6] * d[2], m[1] * d[0] + m[4] * d[1] + m[7] * d[2],
            m[2] * d[0] + m[5] * d[1] + m[8] * d[2]};
  }
  double distance(const Double3& p) const override {
    if constexpr (requires { form_.distance(p); })
      return form_.distance(inverse_.apply(p)).value * per_length_;
    return value(p);
  }
  Double3 away(const Double3& p) const override {
    if constexpr (requires { form_.distance(p); }) {
      const Part part = form_.distance(inverse_.apply(p));
      return placement_.apply_linear(part.direction);  // a similarity turns normals as it turns lengths
    }
    return direction(p);
  }
  bool bounds(Double3& low, Double3& high) const override {
    if constexpr (requires { form_.half_size(); }) {
      const Double3 middle = placement_.apply(form_.middle()), half_size = form_.half_size();
      for (std::size_t a = 0; a < 3; ++a) {
        double maximum = 0.0;
        for (std::size_t b = 0; b < 3; ++b) maximum += std::fabs(placement_.matrix[3 * a + b]) * half_size[b];
        low[a] = middle[a] - maximum;
        high[a] = middle[a] + maximum;
      }
      return true;
    } else {
      return false;
    }
  }

 private:
  Form form_;
  Placement placement_, inverse_;
  double per_length_ = 1.0;
};

/// A ball around a cube of leaves, the next nodes too; world units.
struct Around {
  Double3 middle;
  double radius;
  Around(const Lattice& lattice, const Int3& leaf, int edge) {
    const double half = 0.5 * kLeafCells * edge;
    for (std::size_t a = 0; a < 3; ++a)
      middle[a] = lattice.world(static_cast<int>(a), leaf[a] * double{kLeafCells} + half);
    radius = 1.7321 * half * lattice.h * (1.0 + 1e-6);
  }
};

void search(const SolidShape& shape, const Lattice& lattice, const Int3& leaf, int edge,
            std::vector<LeafWindings>& out) {
  // Nodes of the cube, and the next ones.
  const Around cube(lattice, leaf, edge);
  if (std::fabs(shape.value(cube.middle)) > cube.radius) return;
  if (edge == 1) {
    LeafWindings& found = out.emplace_back();
    found.key = leaf_row_key(leaf);
    found.crossings = kCrossingsPerLeaf;
    return;
  }
  const std::unique_ptr<SolidShape> here = shape.near(cube.middle, cube.radius, cube.radius);
  const int next = edge / 2;
  for (int child = 0; child < 8; ++child)
    search(
        here ? *here : shape, lattice,
        {leaf[0] + (child & 1) * next, leaf[1] + (child >> 1 & 1) * next, leaf[2] + (child >> 2 & 1) * next},
        next, out);
}

}  // namespace

double SolidShape::surface_between(const Double3& from, const Double3& to, bool starts_inside) const {
  const Double3 delta = to - from;
  const double length = norm(delta);
  return find_sign_change(starts_inside, kRootCells, kRootCells,
                          [&](double t) { return value(from + delta * t) / length; });
}

std::size_t shape_numbers(std::string_view kind) {
  constexpr std::array<std::size_t, kShapeKinds.size()> kNumbers = {4, 6, 7, 8, 8, 6};
  for (std::size_t k = 0; k < kShapeKinds.size(); ++k)
    if (kShapeKinds[k] == kind) return kNumbers[k];
  return 0;
}

std::string shape_fault(std::string_view kind, const std::vector<double>& n) {
  for (const double v : n)
    if (!std::isfinite(v)) return "a number is not finite";
  const auto apart = [&](const Double3& a) { return norm(a) > 0.0; };
  if (kind == "sphere" && !(n[3] > 0.0)) return "the radius must be above 0";
  if (kind == "box" && !(n[3] > n[0] && n[4] > n[1] && n[5] > n[2]))
    return "`high` must lie above `low` on every axis";
  if ((kind == "cylinder" || kind == "cone") && !apart(three(n, 3) - three(n, 0)))
    return "both ends of the axis are one point";
  if (kind == "cylinder" && !(n[6] > 0.0)) return "the radius must be above 0";
  if (kind == "cone" && !(n[6] >= 0.0 && n[7] >= 0.0 && n[6] + n[7] > 0.0))
    return "the radii must not be below 0, nor both 0";
  if (kind == "torus" && (!apart(three(n, 3)) || !(n[6] > n[7] && n[7] > 0.0)))
    return "it takes an axis, and a radius of the tube above 0 and below that of the ring";
  if (kind == "halfspace" && !apart(three(n, 3))) return "the normal has no direction";
  return "";
}

std::unique_ptr<SolidShape> make_shape(std::string_view kind, const std::vector<double>& n,
                                       const Placement& placement) {
  if (kind == "sphere") return std::make_unique<Placed<Sphere>>(Sphere{three(n, 0), n[3]}, placement);
  if (kind == "box")
    return std::make_unique<Placed<Box>>(
        Box{(three(n, 0) + three(n, 3)) * 0.5, (three(n, 3) - three(n, 0)) * 0.5}, placement);
  if (kind == "cylinder" || kind == "cone") {
    const Double3 delta = three(n, 3) - three(n, 0);
    const double length = norm(delta), first = n[6], second = kind == "cone" ? n[7] : n[6];
    return std::make_unique<Placed<Cone>>(
        Cone{(three(n, 0) + three(n, 3)) * 0.5, delta / length, 0.5 * length, 0.5 * (first + second),
             (second - first) / length},
        placement);
  }
  if (kind == "torus")
    return std::make_unique<Placed<Torus>>(Torus{three(n, 0), unit(three(n, 3)), n[6], n[7]}, placement);
  return std::make_unique<Placed<HalfSpace>>(HalfSpace{three(n, 0), unit(three(n, 3))}, placement);
}

std::vector<LeafWindings> shape_leaves(const SolidShape& shape, const Lattice& lattice, const Int3& low,
                                       const Int3& high) {
  constexpr int kCube = kBrickCells / kLeafCells;
  std::vector<LeafWindings> out;
  for (int z = low[2]; z <= high[2]; ++z)
    for (int y = low[1]; y <= high[1]; ++y)
      for (int x = low[0]; x <= high[0]; ++x)
        search(shape, lattice, {x * kCube, y * kCube, z * kCube}, kCube, out);
  std::sort(out.begin(), out.end());
  return out;
}

Double3 ShapeSolid::world(const Double3& cells) const {
  return {lattice_.world(0, cells[0]), lattice_.world(1, cells[1]), lattice_.world(2, cells[2])};
}

/// Every edge whose ends differ has a crossing, so one node tells of all.
void ShapeSolid::windings(const Int3& leaf, std::span<const SolidCrossing> crossings, std::span<float> out,
                          BorderRegions&) const {
  const bool first = shape_->holds(world({leaf[0] * 8.0, leaf[1] * 8.0, leaf[2] * 8.0}));
  std::fill(out.begin(), out.end(), first ? 1.0f : 0.0f);
  if (crossings.empty()) return;
  std::array<std::bitset<512>, 3> differs;
  for (const SolidCrossing& c : crossings) differs[c.edge / 512 % 3].flip(c.edge % 512);
  for (std::size_t i = 1; i < out.size(); ++i) {
    const std::size_t axis = (i & 7) != 0 ? 0 : (i >> 3 & 7) != 0 ? 1 : 2;
    const std::size_t before = i - (std::size_t{1} << (3 * axis));
    out[i] = differs[axis][before] ? 1.0f - out[before] : out[before];
  }
}

Double3 ShapeSolid::membrane_normal(const Double3& cells) const {
  return shape_->direction(world(cells));
}

void ShapeSolid::find_crossings(const SolidBlock& block, const Int3& leaf, std::uint8_t operand,
                                std::vector<SolidCrossing>& out) const {
  const Around cube(lattice_, leaf, 1);
  const std::unique_ptr<SolidShape> here = shape_->near(cube.middle, cube.radius, kNearSurface * lattice_.h);
  const SolidShape& shape = here ? *here : *shape_;
  std::array<bool, 9 * 9 * 9> inside;
  const auto at = [](int x, int y, int z) { return static_cast<std::size_t>(x + 9 * (y + 9 * z)); };
  const auto node = [&](int x, int y, int z) {
    return Double3{leaf[0] * 8.0 + x, leaf[1] * 8.0 + y, leaf[2] * 8.0 + z};
  };
  for (int z = 0; z < 9; ++z)
    for (int y = 0; y < 9; ++y)
      for (int x = 0; x < 9; ++x) inside[at(x, y, z)] = shape.holds(world(node(x, y, z)));
  for (std::size_t axis = 0; axis < 3; ++axis)
    for (int z = 0; z < 8; ++z)
      for (int y = 0; y < 8; ++y)
        for (int x = 0; x < 8; ++x) {
          const bool first = inside[at(x, y, z)];
          if (first == inside[at(x + (axis == 0), y + (axis == 1), z + (axis == 2))]) continue;
          Double3 p = node(x, y, z);
          Double3 next = p;
          ++next[axis];
          const double high = shape.surface_between(world(p), world(next), first);
          p[axis] += high;
          LatticeCrossing c;
          c.node = {leaf[0] * 8 + x, leaf[1] * 8 + y, leaf[2] * 8 + z};
          c.axis = static_cast<std::uint8_t>(axis);
          c.winding = first ? std::int8_t{-1} : std::int8_t{1};
          c.t = high;
          out.push_back(block.local_crossing(c, narrow(unit_or_zero(shape.direction(world(p)))), operand));
        }
}

}  // namespace tessera

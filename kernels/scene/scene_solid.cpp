#include "kernels/scene/scene_solid.h"

#include <array>

#include "kernels/scene/solid.h"

namespace tessera::synth {
namespace {

/// Faces of an axis-parallel block, each with its own trim (order: -x +x -y +y -z +z).
void add_block_faces(Solid& solid, const Double3& lo, const Double3& hi, const std::array<Trim, 6>& trims) {
  const Double3 d = hi - lo;
  const Double3 x{d[0], 0, 0}, y{0, d[1], 0}, z{0, 0, d[2]};
  solid.add(plane_face(lo, z, y, trims[0]));
  solid.add(plane_face(lo + x, y, z, trims[1]));
  solid.add(plane_face(lo, x, z, trims[2]));
  solid.add(plane_face(lo + y, z, x, trims[3]));
  solid.add(plane_face(lo, y, x, trims[4]));
  solid.add(plane_face(lo + z, x, y, trims[5]));
}

void add_block_edges(Solid& solid, const Double3& lo, const Double3& hi) {
  const auto corner = [&](int k) {
    return Double3{k & 1 ? hi[0] : lo[0], k & 2 ? hi[1] : lo[1], k & 4 ? hi[2] : lo[2]};
  };
  for (int k = 0; k < 8; ++k) {
    solid.add_corner(corner(k));
    for (const int bit : {1, 2, 4}) {
      if (!(k & bit)) solid.add(Crease::line(corner(k), corner(k | bit)));
    }
  }
}

// ---------------------------------------------------------------------------------------------- profiles

struct Point2 {
  double x, y;
};

/// Piece of a closed profile: a line, or an arc of at most a quarter turn about (cx, cy), from angle `from`
/// to `to` (clockwise if to < from).
struct ProfilePiece {
  Point2 a, b;
  bool arc = false;
  Point2 centre = {0, 0};
  double radius = 0.0, from = 0.0, to = 0.0;
  bool sharp_start = false;  ///< the joint at `a` is a crease
};

class Profile {
 public:
  void line(Point2 a, Point2 b, bool sharp_start) {
    pieces_.push_back({a, b, false, {0, 0}, 0, 0, 0, sharp_start});
  }
  /// Quarter turns from quarter `q0` to `q1` (angles in units of 90 degrees).
  void arc(Point2 centre, double radius, int q0, int q1, bool sharp_start) {
    const auto at = [&](int q) {
      constexpr double c[4] = {1, 0, -1, 0}, s[4] = {0, 1, 0, -1};
      return Point2{centre.x + radius * c[q & 3], centre.y + radius * s[q & 3]};
    };
    const int step = q1 > q0 ? 1 : -1;
    for (int q = q0; q != q1; q += step) {
      pieces_.push_back({at(q), at(q + step), true, centre, radius, 0.5 * kPi * q, 0.5 * kPi * (q + step),
                         sharp_start && q == q0});
    }
  }
  const std::vector<ProfilePiece>& pieces() const { return pieces_; }

  /// Parity of the chord polygon, then of the segments between chord and arc. Both use the same expression
  /// for the side of a chord, so that points on a chord fall consistently.
  bool inside(double x, double y) const {
    bool in = false;
    for (const auto& p : pieces_) {
      const double side = (p.b.x - p.a.x) * (y - p.a.y) - (p.b.y - p.a.y) * (x - p.a.x);
      const bool up = p.a.y <= y && y < p.b.y, down = p.b.y <= y && y < p.a.y;
      if ((up && side > 0.0) || (down && side < 0.0)) in = !in;
      if (!p.arc) continue;
      const double dx = x - p.centre.x, dy = y - p.centre.y;
      if (dx * dx + dy * dy >= p.radius * p.radius) continue;
      const bool rising = p.b.y > p.a.y;
      const bool left = rising ? side > 0.0 : side >= 0.0;  // which side a point on the chord was counted to
      // A counter-clockwise arc bulges to the right of its chord, a clockwise one to the left.
      if (left == (p.to < p.from)) in = !in;
    }
    return in;
  }

 private:
  std::vector<ProfilePiece> pieces_;
};

/// Extrudes a profile (outer loops counter-clockwise, holes clockwise) from z = low to z = height + slope .
/// (x, y).
void add_prism(Solid& solid, const Profile& profile, Point2 lo, Point2 hi, double low, double height,
               Point2 slope) {
  const auto top = [=](double x, double y) { return height + slope.x * x + slope.y * y; };
  const Trim trim = [profile](const Double3& p) { return profile.inside(p[0], p[1]); };
  const double dx = hi.x - lo.x, dy = hi.y - lo.y;
  solid.add(plane_face({lo.x, lo.y, low}, {0, dy, 0}, {dx, 0, 0}, trim));
  solid.add(plane_face({lo.x, lo.y, top(lo.x, lo.y)}, {dx, 0, slope.x * dx}, {0, dy, slope.y * dy}, trim));
  for (const auto& p : profile.pieces()) {
    const Double3 a0{p.a.x, p.a.y, low}, b0{p.b.x, p.b.y, low};
    const Double3 a1{p.a.x, p.a.y, top(p.a.x, p.a.y)}, b1{p.b.x, p.b.y, top(p.b.x, p.b.y)};
    if (p.sharp_start) {
      solid.add(Crease::line(a0, a1));
      solid.add_corner(a0);
      solid.add_corner(a1);
    }
    if (!p.arc) {
      const double tallest = a1[2] > b1[2] ? a1[2] : b1[2];
      // Rectangle up to the higher end, trimmed by the oblique plane.
      const Trim below = slope.x == 0.0 && slope.y == 0.0
                             ? Trim{}
                             : Trim{[top](const Double3& q) { return q[2] <= top(q[0], q[1]); }};
      solid.add(plane_face(a0, b0 - a0, {0, 0, tallest - low}, below));
      solid.add(Crease::line(a0, b0));
      solid.add(Crease::line(a1, b1));
      continue;
    }
    const bool clockwise = p.to < p.from;
    CylinderShape shape;
    shape.centre = {p.centre.x, p.centre.y, 0};
    shape.axis = {0, 0, 1};
    shape.x = {1, 0, 0};
    shape.radius = p.radius;
    shape.from = clockwise ? p.to : p.from;
    shape.to = clockwise ? p.from : p.to;
    shape.low = low;
    shape.top_height = top(p.centre.x, p.centre.y);
    shape.top_slope = {slope.x, slope.y, 0};
    shape.inward = clockwise;
    solid.add(cylinder_face(shape));
    const Double3 a{p.radius, 0, 0}, b{0, p.radius, 0};
    solid.add(Crease::arc({p.centre.x, p.centre.y, low}, a, b, shape.from, shape.to));
    solid.add(Crease::arc({p.centre.x, p.centre.y, shape.top_height}, a + Double3{0, 0, slope.x * p.radius},
                          b + Double3{0, 0, slope.y * p.radius}, shape.from, shape.to));
  }
}

}  // namespace

std::unique_ptr<Scene> make_cube() {
  const Double3 lo{-1, -1, -1}, hi{1, 1, 1};
  auto solid = std::make_unique<Solid>("cube", Box3{lo, hi});
  add_block_faces(*solid, lo, hi, {});
  add_block_edges(*solid, lo, hi);
  return solid;
}

std::unique_ptr<Scene> make_csg() {
  constexpr double kRod = 0.55, kRodEnd = 1.3, kBore = 0.35;
  const Double3 lo{-1.2, -1.0, -0.8}, hi{1.2, 1.0, 0.8};
  auto solid = std::make_unique<Solid>("csg", Box3{{lo[0], lo[1], -kRodEnd}, {hi[0], hi[1], kRodEnd}});
  const Trim outside_rod = [](const Double3& p) { return p[0] * p[0] + p[1] * p[1] >= kRod * kRod; };
  const Trim inside_rod = [](const Double3& p) { return p[0] * p[0] + p[1] * p[1] <= kRod * kRod; };
  const Trim outside_bore = [](const Double3& p) { return p[1] * p[1] + p[2] * p[2] >= kBore * kBore; };
  add_block_faces(*solid, lo, hi, {outside_bore, outside_bore, Trim{}, Trim{}, outside_rod, outside_rod});
  add_block_edges(*solid, lo, hi);
  const auto circle = [&](const Double3& centre, const Double3& a, const Double3& b) {
    solid->add(Crease::arc(centre, a, b, 0.0, 2.0 * kPi));
  };
  const Double3 rx{kRod, 0, 0}, ry{0, kRod, 0}, by{0, kBore, 0}, bz{0, 0, kBore};
  for (const double side : {-1.0, 1.0}) {
    CylinderShape rod;
    rod.axis = {0, 0, side};
    rod.x = {1, 0, 0};
    rod.radius = kRod;
    rod.low = hi[2];
    rod.top_height = kRodEnd;
    solid->add(cylinder_face(rod));
    const Double3 end{-kRod, -kRod, side * kRodEnd};
    const Double3 across{2 * kRod, 0, 0}, along{0, 2 * kRod, 0};
    solid->add(side > 0 ? plane_face(end, across, along, inside_rod)
                        : plane_face(end, along, across, inside_rod));
    circle({0, 0, side * hi[2]}, rx, ry);
    circle({0, 0, side * kRodEnd}, rx, ry);
    circle({side * hi[0], 0, 0}, by, bz);
  }
  CylinderShape bore;
  bore.axis = {1, 0, 0};
  bore.x = {0, 1, 0};
  bore.radius = kBore;
  bore.low = lo[0];
  bore.top_height = hi[0];
  bore.inward = true;
  solid->add(cylinder_face(bore));
  return solid;
}

std::unique_ptr<Scene> make_fandisk() {
  Profile profile;
  profile.line({-1.1, -0.6}, {0.5, -0.6}, true);
  profile.arc({0.5, -0.1}, 0.5, -1, 0, false);
  profile.line({1.0, -0.1}, {1.0, 0.2}, false);
  profile.line({1.0, 0.2}, {0.6, 0.2}, true);
  profile.arc({0.6, 0.6}, 0.4, 3, 2, false);  // the hollow: clockwise
  profile.line({0.2, 0.6}, {0.2, 0.9}, false);
  profile.line({0.2, 0.9}, {-0.4, 0.9}, true);
  profile.arc({-0.4, 0.2}, 0.7, 1, 2, false);
  profile.line({-1.1, 0.2}, {-1.1, -0.6}, false);
  profile.arc({-0.4, 0.2}, 0.3, 4, 0, false);  // the bore
  auto solid = std::make_unique<Solid>("fandisk", Box3{{-1.1, -0.6, -0.5}, {1.0, 0.9, 0.85}});
  add_prism(*solid, profile, {-1.1, -0.6}, {1.0, 0.9}, -0.5, 0.5, {0.25, 0.1});
  return solid;
}

}  // namespace tessera::synth

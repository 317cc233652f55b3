#include "kernels/solid/offset_field.h"

#include <algorithm>
#include <cmath>

namespace tessera {
namespace {

constexpr double kQuantum = 0x1p-20;  ///< cells
/// Cells from the mesh within which its faces' normals stand for directions.
constexpr double kOnSurface = 0x1p-6;
constexpr double kCubeDiagonal = 1.7321;

MeshBlock without_names(MeshBlock&& block) {
  block.key.clear(), block.key.shrink_to_fit();
  block.vertex_class.clear(), block.vertex_class.shrink_to_fit();
  return std::move(block);
}

/// Barycentric coordinates of a foot in its face: 0 for corners that what it lies on does not have.
std::array<double, 3> weights_at(const TriangleFoot& on, const std::array<Double3, 3>& corner) {
  std::array<double, 3> weight{};
  if (on.corner >= 0) {
    weight[static_cast<std::size_t>(on.corner)] = 1.0;
  } else if (on.edge >= 0) {
    const auto from = static_cast<std::size_t>(on.edge), to = (from + 1) % 3;
    const Double3 side = corner[to] - corner[from];
    weight[to] = std::clamp(dot(on.at - corner[from], side) / dot(side, side), 0.0, 1.0);
    weight[from] = 1.0 - weight[to];
  } else {
    const Double3 area = triangle_normal(corner[0], corner[1], corner[2]);
    const double square = dot(area, area);
    for (const std::size_t k : {1, 2})
      weight[k] = std::clamp(
          dot(triangle_normal(on.at, corner[(k + 1) % 3], corner[(k + 2) % 3]), area) / square, 0.0, 1.0);
    weight[0] = std::max(0.0, 1.0 - weight[1] - weight[2]);
  }
  return weight;
}

}  // namespace

double OffsetLayer::max_distance() const {
  return mitre * (std::isinf(low) ? std::fabs(high) : std::max(std::fabs(low), std::fabs(high)));
}

bool OffsetLayer::may_pass(double away, bool inside, double radius) const {
  // Signed distances that may be met: outside from near / mitre to far, inside the other way round.
  const double near = away - radius, far = away + radius;
  double from = near > 0.0 ? near / mitre : near, to = far;
  if (inside) {
    to = near > 0.0 ? -near / mitre : -near;
    from = -far;
  }
  const auto passes = [&](double side) { return from <= side && side <= to; };
  return passes(high) || (!std::isinf(low) && passes(low));
}

void quantise_cells(const Lattice& lattice, const Int3& corner, MeshBlock& block) {
  for (Double3& p : block.position)
    for (std::size_t a = 0; a < 3; ++a) {
      const double cells = p[a] / lattice.h - static_cast<double>(lattice.origin_brick[a] * kBrickCells);
      p[a] = std::floor(cells / kQuantum + 0.5) * kQuantum - corner[a];
    }
}

OffsetSampler::OffsetSampler(MeshBlock&& faces, const Int3& corner, const RowSigns& signs,
                             const OffsetLayer& layer, double near)
    : faces_(without_names(std::move(faces))),
      surface_(faces_, {0, 0, 0}),
      sheets_(layer.mitre > 1.0 ? CreaseSheets(faces_) : CreaseSheets()),
      corner_(corner),
      layer_(layer),
      near_(near),
      limit_square_((layer.max_distance() + near + 1.0) * (layer.max_distance() + near + 1.0)),
      signs_(signs) {}

bool OffsetSampler::inside(const Int3& node) const {
  return signs_.inside(node);
}

double OffsetSampler::between(double distance) const {
  return std::isinf(layer_.low) ? distance - layer_.high
                                : std::max(distance - layer_.high, layer_.low - distance);
}

FieldSampler::Sample OffsetSampler::at(const Int3& node, std::size_t axis, double t) const {
  Double3 p;
  for (std::size_t k = 0; k < 3; ++k) p[k] = node[k] - corner_[k] + (k == axis ? t : 0.0);
  Sample sample;
  const SignedDistance::Foot foot = surface_.closest(p, limit_square_, hint_);
  if (foot.face == SignedDistance::kNone) return sample;
  hint_ = foot.slot;
  bool within = inside(node);
  if (t > 0.0) {
    // Faces cross an edge with ends on two sides: there the nearest one tells the side.
    Int3 end = node;
    ++end[axis];
    if (inside(end) != within) within = SignedDistance::signed_distance(p, foot) < 0.0;
  }
  double away = std::sqrt(foot.square);
  sample.there = layer_.mitre == 1.0 || layer_.may_pass(away, within, kNear);
  // From the point, so that the numbers are the same in every block.
  const auto& f = faces_.faces[foot.face];
  if (away > kOnSurface) {
    const std::array<Double3, 3> corner = {faces_.position[f[0]] - p, faces_.position[f[1]] - p,
                                           faces_.position[f[2]] - p};
    const TriangleFoot on = foot_in_triangle({0, 0, 0}, corner[0], corner[1], corner[2]);
    sample.normal = within ? on.at : -on.at;
    if (layer_.mitre > 1.0) {
      sample.normal = sample.normal / away;
      away = mitred(f, on, corner, away, within ? 1.0 : -1.0, sample.normal);
    }
  } else {
    sample.normal = surface_.face_normal(foot.face);
  }
  const double distance = within ? -away : away;
  sample.value = between(distance);
  const bool lower = !std::isinf(layer_.low) && layer_.low - distance > distance - layer_.high;
  if (lower) sample.normal = -sample.normal;
  return sample;
}

double OffsetSampler::mitred(const std::array<std::uint32_t, 3>& face, const TriangleFoot& on,
                             const std::array<Double3, 3>& corner, double away, double side,
                             Double3& outward) const {
  if (sheets_.at(face[0]).empty() && sheets_.at(face[1]).empty() && sheets_.at(face[2]).empty()) return away;
  const std::array<double, 3> weight = weights_at(on, corner);
  double distance = away;
  Double3 direction = outward;
  for (std::size_t k = 0; k < 3; ++k) {
    const double share = weight[k] * sheets_.share(face[k]);
    if (!(share > 0.0)) continue;
    double maximum = 0.0;
    Double3 normal{};
    for (const Double3& n : sheets_.at(face[k])) {
      const double along = side * dot(on.at, n);  // towards the foot
      if (along > maximum) maximum = along, normal = n;
    }
    if (!(maximum > 0.0) || maximum >= away) continue;
    if (maximum > away / layer_.mitre) {
      distance -= share * (away - maximum);
      direction = direction + (normal - outward) * share;
    } else {
      distance -= share * (away - away / layer_.mitre);
    }
  }
  outward = direction;
  return distance;
}

std::vector<Int3> OffsetSampler::leaves(const Int3& cells) const {
  std::vector<Int3> out;
  constexpr int kCube = kBrickCells / kLeafCells;
  for (int z = -kCube; z <= cells[2] / kLeafCells; z += kCube)
    for (int y = -kCube; y <= cells[1] / kLeafCells; y += kCube)
      for (int x = -kCube; x <= cells[0] / kLeafCells; x += kCube) search(cells, {x, y, z}, kCube, out);
  return out;
}

bool OffsetSampler::may_pass(const Int3& middle, int edge) const {
  // Nodes of the cube and the next ones are no farther from its middle. Distances change no faster than places.
  const double radius = kCubeDiagonal * (0.5 * kLeafCells * edge + 1.0);
  Double3 p;
  for (std::size_t k = 0; k < 3; ++k) p[k] = middle[k] - corner_[k];
  const double seen = layer_.max_distance() + radius + near_;
  const SignedDistance::Foot foot = surface_.closest(p, seen * seen, hint_);
  if (foot.face == SignedDistance::kNone) return false;
  hint_ = foot.slot;
  const double away = std::sqrt(foot.square), distance = inside(middle) ? -away : away;
  if (layer_.mitre > 1.0) return layer_.may_pass(away, inside(middle), radius + near_);
  return std::fabs(distance - layer_.high) <= radius + near_ ||
         (!std::isinf(layer_.low) && std::fabs(distance - layer_.low) <= radius + near_);
}

/// \param leaf  of the cube's corner, relative to the block  \param edge  of the cube, leaves
void OffsetSampler::search(const Int3& cells, const Int3& leaf, int edge, std::vector<Int3>& out) const {
  Int3 middle;
  for (std::size_t k = 0; k < 3; ++k) {
    if (leaf[k] + edge <= -1 || leaf[k] > cells[k] / kLeafCells) return;
    middle[k] = corner_[k] + kLeafCells * leaf[k] + kLeafCells * edge / 2;
  }
  // Of a large cube that reaches out of the block not all faces around are known.
  bool whole = true;
  for (std::size_t k = 0; k < 3; ++k)
    whole = whole && leaf[k] >= 0 && leaf[k] + edge <= cells[k] / kLeafCells;
  if ((whole || edge == 1) && !may_pass(middle, edge)) return;
  if (edge == 1) {
    out.push_back(leaf);
    return;
  }
  const int half = edge / 2;
  for (int child = 0; child < 8; ++child)
    search(
        cells,
        {leaf[0] + (child & 1) * half, leaf[1] + (child >> 1 & 1) * half, leaf[2] + (child >> 2 & 1) * half},
        half, out);
}

}  // namespace tessera

#include "kernels/decimate/crossing_guard.h"

#include <immintrin.h>

#include <algorithm>
#include <cmath>
#include <utility>

#include "kernels/mesh/block_contacts.h"

namespace tessera {

/// The outline of a disk of faces, seen along an axis: a face that lies beyond a side of its convex hull meets those inside in
/// corners of that side alone. Nearly all faces around a disk do. In floats, with room for their rounding.
class CrossingGuard::Outline {
 public:
  /// \param inside  a corner of the faces that is none of the outline
  Outline(const CollapseMesh& mesh, std::span<const std::uint32_t> vertices, const Double3* inside = nullptr)
      : mesh_(mesh) {
    const std::size_t n = vertices.size();
    if (n < 3 || n > kMaxSides) return;
    sides_ = static_cast<unsigned>(n);
    for (std::size_t i = 0; i < n; ++i) corner_[i] = static_cast<int>(vertices[i]);
    const Double3& first = mesh.at(vertices[0]);
    Double3 normal{};
    double size = 0.0;
    for (std::size_t i = 1; i < n; ++i) {
      const Double3 at = mesh.at(vertices[i]) - first;
      size = std::max({size, std::fabs(at[0]), std::fabs(at[1]), std::fabs(at[2])});
      if (i + 1 < n) normal = normal + cross(at, mesh.at(vertices[i + 1]) - first);
    }
    std::size_t axis = 0;
    for (std::size_t k = 1; k < 3; ++k)
      if (std::fabs(normal[k]) > std::fabs(normal[axis])) axis = k;
    if (!(std::fabs(normal[axis]) > 0.0)) return;
    // Counter-clockwise.
    axes_ = {static_cast<int>((axis + 1) % 3), static_cast<int>((axis + 2) % 3)};
    if (normal[axis] < 0.0) std::swap(axes_[0], axes_[1]);
    flat_axes_ = _mm_setr_epi32(axes_[0], axes_[1], axes_[1], axes_[1]);
    origin_ = _mm256_setr_pd(first[0], first[1], first[2], 0.0);
    scale_ = _mm256_set1_pd(1.0 / size);
    std::array<Float2, kMaxSides> p;
    for (std::size_t i = 0; i < n; ++i) {
      alignas(16) std::array<float, 4> lanes;
      _mm_store_ps(lanes.data(), flat(at(vertices[i])));
      p[i] = {lanes[0], lanes[1]};
    }
    for (std::size_t i = 0; i < n; ++i) {
      const Float2 &from = p[i], &to = p[i + 1 < n ? i + 1 : 0];
      dx_[i] = to[0] - from[0], dy_[i] = to[1] - from[1];
      shift_[i] = dx_[i] * from[1] - dy_[i] * from[0];
    }
    usable_ = (1u << n) - 1u;
    for (unsigned i = 0; i < n; ++i) usable_ &= sides_of(at(vertices[i]), -1.0f) | 1u << i | before(1u << i);
    if (inside != nullptr)
      usable_ &= sides_of(_mm256_setr_pd((*inside)[0], (*inside)[1], (*inside)[2], 0.0), -1.0f);
  }

  /// \param f  of the mesh
  bool apart(const CollapseFace& f) const {
    unsigned sides = usable_;
    for (std::size_t k = 0; k < 3 && sides != 0; ++k) {
      // Corners of the outline are ends of two sides and lie on the inner side of the others.
      const unsigned corner = corner_bits(f.vertex[k]);
      sides &= corner != 0 ? corner | before(corner) : sides_of(at(f.vertex[k]), 1.0f);
    }
    return sides != 0;
  }

  /// Whether the faces, a fan around their first corner, surely meet in what they share alone: seen along the axis they lie side
  /// by side between the two sides at that corner.
  bool tiled_by(std::span<const ContactFace> faces) const {
    if (usable_ == 0) return false;
    const auto centre = static_cast<std::uint32_t>(faces.front().vertex[0]);
    const unsigned corner = corner_bits(centre), sides = corner | before(corner);
    if (corner == 0 || (usable_ & sides) != sides) return false;
    for (const ContactFace& f : faces) {
      if (f.vertex[0] != centre) return false;
      const Double3 a = f.corner[1] - f.corner[0], b = f.corner[2] - f.corner[0];
      const auto x = static_cast<std::size_t>(axes_[0]), y = static_cast<std::size_t>(axes_[1]);
      const double p = a[x] * b[y], q = a[y] * b[x];
      if (!(p - q > 1e-14 * (std::fabs(p) + std::fabs(q)))) return false;
    }
    return true;
  }

 private:
  static constexpr std::size_t kMaxSides = 8;
  using Float2 = std::array<float, 2>;

  /// With what follows the position in a vertex.
  __m256d at(std::uint32_t v) const { return _mm256_load_pd(mesh_.at(v).data()); }
  /// Where a place is seen, in sizes of the outline.
  __m128 flat(__m256d at) const {
    const __m128 p = _mm256_cvtpd_ps(_mm256_mul_pd(_mm256_sub_pd(at, origin_), scale_));
    return _mm_permutevar_ps(p, flat_axes_);
  }

  /// The bit of the side that begins at this corner; 0 for other vertices.
  unsigned corner_bits(std::uint32_t v) const {
    const __m256i corners = _mm256_load_si256(reinterpret_cast<const __m256i*>(corner_.data()));
    const __m256i same = _mm256_cmpeq_epi32(corners, _mm256_set1_epi32(static_cast<int>(v)));
    return static_cast<unsigned>(_mm256_movemask_ps(_mm256_castsi256_ps(same)));
  }
  /// The side that ends where this one begins.
  unsigned before(unsigned side) const { return (side >> 1 | side << (sides_ - 1u)) & ((1u << sides_) - 1u); }

  /// A bit for each side that has the place surely beyond it (1) or on its inner side (-1).
  unsigned sides_of(__m256d place, float direction) const {
    const __m128 p = flat(place);
    const __m256 x = _mm256_broadcastss_ps(p), y = _mm256_broadcastss_ps(_mm_movehdup_ps(p));
    const __m256 a = _mm256_mul_ps(_mm256_load_ps(dy_.data()), x),
                 b = _mm256_mul_ps(_mm256_load_ps(dx_.data()), y), c = _mm256_load_ps(shift_.data());
    const __m256 beyond = _mm256_mul_ps(_mm256_sub_ps(_mm256_add_ps(a, c), b), _mm256_set1_ps(direction));
    const __m128 far = _mm_andnot_ps(_mm_set1_ps(-0.0f), p);
    const __m128 terms = _mm_add_ps(_mm_add_ps(far, _mm_movehdup_ps(far)), _mm_set1_ps(2.0f));
    const __m256 doubt = _mm256_broadcastss_ps(_mm_mul_ps(terms, _mm_set1_ps(kRounding)));
    const __m256 sure = _mm256_cmp_ps(beyond, doubt, _CMP_GT_OQ);
    return static_cast<unsigned>(_mm256_movemask_ps(sure));
  }

  /// More than what rounding of the terms comes to, in sizes of the outline and of how far away the vertex is.
  static constexpr float kRounding = 0x1p-20f;

  const CollapseMesh& mesh_;
  __m256d origin_ = _mm256_setzero_pd(), scale_ = origin_;
  __m128i flat_axes_ = _mm_setzero_si128();
  std::array<int, 2> axes_ = {0, 1};
  unsigned sides_ = 0;
  unsigned usable_ = 0;  ///< sides that have all of the outline on their inner side
  alignas(32) std::array<float, kMaxSides> dx_{}, dy_{}, shift_{};
  alignas(32) std::array<int, kMaxSides> corner_ = {-1, -1, -1, -1, -1, -1, -1, -1};
};

namespace {

/// Whether a vertex that is put where it was not lies exactly on another one.
bool is_put_on_another(const ContactFace& a, const ContactFace& b, std::uint64_t moved) {
  for (std::size_t i = 0; i < 3; ++i)
    for (std::size_t j = 0; j < 3; ++j)
      if (a.vertex[i] != b.vertex[j] && (a.vertex[i] == moved || b.vertex[j] == moved) &&
          a.corner[i] == b.corner[j])
        return true;
  return false;
}

/// Fans that hang together in copies of a vertex meet there whatever is done: counted, that would allow as many crossings. But
/// no vertex is to become a copy of another.
bool guarded_meet(const ContactFace& a, const ContactFace& b, std::uint64_t moved) {
  return face_contact(a, b) != FaceContact::kNone &&
         (is_put_on_another(a, b, moved) || !meet_in_copies(a, b));
}

}  // namespace

ContactFace CrossingGuard::contact_face(std::uint32_t f) const {
  const std::uint32_t* v = mesh_.face(f).vertex;
  return {{mesh_.at(v[0]), mesh_.at(v[1]), mesh_.at(v[2])}, {v[0], v[1], v[2]}};
}

FaceBoxes::Box CrossingGuard::box_of(std::uint32_t f) const {
  const CollapseFace& face = mesh_.face(f);
  if ((face.state & kStateDead) != 0) return FaceBoxes::kNothing;
  const std::array<Double3, 3> at = {mesh_.at(face.vertex[0]), mesh_.at(face.vertex[1]),
                                     mesh_.at(face.vertex[2])};
  return boxes_.box(at);
}

void CrossingGuard::prefetch_corners(std::uint32_t f) const {
  for (const std::uint32_t v : mesh_.face(f).vertex) __builtin_prefetch(&mesh_.at(v));
}

void CrossingGuard::build() {
  built_ = true;
  if (mesh_.vertices() == 0) return;
  Double3 low = mesh_.at(0), high = low;
  for (std::uint32_t v = 1; v < mesh_.vertices(); ++v)
    for (std::size_t k = 0; k < 3; ++k) {
      low[k] = std::min(low[k], mesh_.at(v)[k]);
      high[k] = std::max(high[k], mesh_.at(v)[k]);
    }
  boxes_ = FaceBoxes(low, high);
  std::vector<FaceBoxes::Steps> steps(mesh_.vertices());
  for (std::uint32_t v = 0; v < steps.size(); ++v) steps[v] = boxes_.steps(mesh_.at(v));
  std::vector<FaceBoxes::Box> boxes(mesh_.faces().size(), FaceBoxes::kNothing);
  for (std::uint32_t f = 0; f < boxes.size(); ++f) {
    const CollapseFace& face = mesh_.face(f);
    if ((face.state & kStateDead) == 0)
      boxes[f] = FaceBoxes::around(steps[face.vertex[0]], steps[face.vertex[1]], steps[face.vertex[2]]);
  }
  boxes_.build(boxes, order_);
}

void CrossingGuard::accept() {
  if (!built_) return;
  for (const std::uint32_t f : gone_) boxes_.set(f, box_of(f));
}

void CrossingGuard::accept_collapse(const Star& star) {
  if (!leaves_sheets_) tell_sheets(star);
  if (!built_) return;
  if (made_box_.size() != made_.size()) find_boxes(made_, made_box_);  // nothing was looked for
  for (const std::uint32_t f : gone_)
    if ((mesh_.face(f).state & kStateDead) != 0) boxes_.set(f, FaceBoxes::kNothing);
  for (std::size_t i = 0; i < made_face_.size(); ++i) boxes_.set(made_face_[i], made_box_[i]);
}

void CrossingGuard::accept_unasked(const Star& star) {
  if (marked_) {
    made_.clear();
    for (std::size_t i = 0; i < star.faces; ++i)
      if ((mesh_.face(star.corner[i] >> 2).state & kStateDead) == 0)
        made_.push_back(contact_face(star.corner[i] >> 2));
    if (!star.closed || !sheets_.look_along(made_)) tell_sheets(star);
  }
  if (!built_) return;
  ring_.clear();
  for (std::size_t i = 0; i < star.ring_size(); ++i) ring_.push_back(mesh_.at(star.ring[i]));
  const FaceBoxes::Box all = boxes_.box(ring_);
  for (std::size_t i = 0; i < star.faces; ++i) {
    const std::uint32_t f = star.corner[i] >> 2;
    boxes_.set(f, (mesh_.face(f).state & kStateDead) != 0 ? FaceBoxes::kNothing : all);
  }
}

bool CrossingGuard::meets(std::uint32_t face) {
  before_ = {contact_face(face)};
  if (marked_ && sheets_.certain(before_)) return false;
  if (!built_) build();
  gone_ = {face}, removed_ = kNoCorner, moved_ = kNobody;
  find_boxes(before_, before_box_);
  return contacts(before_, before_box_, Outline(mesh_, {}), 1) > 0;
}

void CrossingGuard::begin(std::uint32_t removed) {
  gone_.clear(), made_.clear(), made_face_.clear(), made_box_.clear();
  removed_ = removed, moved_ = kNobody;
  leaves_sheets_ = false;
}

/// Whether the collapse at hand surely adds none.
bool CrossingGuard::in_sheet(const Star& star) {
  if (!by_sheets_) return false;
  if (!marked_) sheets_ = SheetMarks(mesh_), marked_ = true;
  leaves_sheets_ = star.closed && sheets_.look_along(made_);
  return leaves_sheets_ && sheets_.certain(made_);
}

/// Around all that a collapse of the star makes, and the edges that it may leave without another side.
void CrossingGuard::tell_sheets(const Star& star) {
  if (!marked_) return;
  ring_.clear();
  for (const ContactFace& f : made_) ring_.insert(ring_.end(), f.corner.begin(), f.corner.end());
  for (std::size_t i = 0; i < star.ring_size(); ++i) ring_.push_back(mesh_.at(star.ring[i]));
  sheets_.doubt(ring_);
}

/// Faces of a star whose centre is now called `name` and lies elsewhere; those with the other end of a collapsing edge go.
void CrossingGuard::take_star(const Star& star, std::uint32_t other_end, std::uint32_t name,
                              const Double3& to) {
  for (std::size_t i = 0; i < star.faces; ++i) {
    const std::uint32_t c = star.corner[i], a = mesh_.vertex(next_corner(c)),
                        b = mesh_.vertex(prev_corner(c));
    gone_.push_back(c >> 2);
    if (a == other_end || b == other_end) continue;
    made_.push_back({{to, mesh_.at(a), mesh_.at(b)}, {name, a, b}});
    made_face_.push_back(c >> 2);
  }
}

bool CrossingGuard::collapse_adds(const Star& star, std::size_t at) {
  begin(mesh_.vertex(star.corner[0]));
  const std::uint32_t v = star.ring[at];
  take_star(star, v, v, mesh_.at(v));
  made_meet_ = false;
  if (in_sheet(star)) return false;
  return adds(Outline(mesh_, {star.ring.data(), star.ring_size()}));
}

bool CrossingGuard::collapse_adds(const Star& star, std::size_t at, const Star& other, const Double3& to) {
  const std::uint32_t u = mesh_.vertex(star.corner[0]), v = star.ring[at];
  begin(u);
  if (!(to == mesh_.at(v))) moved_ = v;
  take_star(star, v, v, to);
  const auto own = static_cast<std::ptrdiff_t>(gone_.size());
  take_star(other, u, v, to);
  // The faces at the edge are of both stars.
  const auto twice = [&](std::uint32_t f) {
    return std::find(gone_.begin(), gone_.begin() + own, f) != gone_.begin() + own;
  };
  gone_.erase(std::remove_if(gone_.begin() + own, gone_.end(), twice), gone_.end());
  return adds(Outline(mesh_, {}));
}

bool CrossingGuard::move_adds(const Star& star, const Double3& to) {
  begin(kNoCorner);
  const std::uint32_t v = mesh_.vertex(star.corner[0]);
  if (!(to == mesh_.at(v))) moved_ = v;
  take_star(star, v, v, to);
  return adds(star.closed ? Outline(mesh_, {star.ring.data(), star.faces}, &to) : Outline(mesh_, {}));
}

bool CrossingGuard::flip_adds(std::uint32_t corner) {
  const std::uint32_t across = mesh_.opposite(corner);
  const std::array<std::uint32_t, 4> v = {mesh_.vertex(corner), mesh_.vertex(next_corner(corner)),
                                          mesh_.vertex(across), mesh_.vertex(prev_corner(corner))};
  begin(kNoCorner);
  gone_ = {corner >> 2, across >> 2};
  made_ = {{{mesh_.at(v[0]), mesh_.at(v[1]), mesh_.at(v[2])}, {v[0], v[1], v[2]}},
           {{mesh_.at(v[0]), mesh_.at(v[2]), mesh_.at(v[3])}, {v[0], v[2], v[3]}}};
  return adds(Outline(mesh_, v));
}

void CrossingGuard::find_boxes(std::span<const ContactFace> faces, std::vector<FaceBoxes::Box>& boxes) const {
  boxes.clear();
  for (const ContactFace& f : faces) boxes.push_back(boxes_.box(f.corner));
}

/// Pairs of one of these and a face that stays, or another of these, counted until there are `enough`.
std::size_t CrossingGuard::contacts(std::span<const ContactFace> faces, std::span<const FaceBoxes::Box> boxes,
                                    const Outline& outline, std::size_t enough) {
  planes_.clear();
  FaceBoxes::Box all = FaceBoxes::kNothing;
  for (const FaceBoxes::Box& b : boxes) all.add(b);
  // Seldom asked for: the outline tells nearly all faces apart.
  const auto find_planes = [&] {
    for (const ContactFace& f : faces) {
      if (planes_.empty() || planes_.back().size() == FacePlanes::kLanes) planes_.emplace_back();
      planes_.back().add(f);
    }
  };
  std::size_t found = 0;
  const auto test = [&](std::uint32_t other) {
    ++looked_at_;
    const CollapseFace& its = mesh_.face(other);
    if (its.vertex[0] == removed_ || its.vertex[1] == removed_ || its.vertex[2] == removed_) return;
    if (outline.apart(its) || std::find(gone_.begin(), gone_.end(), other) != gone_.end()) return;
    if (planes_.empty()) find_planes();
    const FaceBoxes::Box box = boxes_.at(other);
    const ContactFace face = contact_face(other);
    for (std::size_t g = 0; g < planes_.size(); ++g) {
      const unsigned all_of_it = (1u << planes_[g].size()) - 1u;
      for (unsigned bits = all_of_it & ~planes_[g].apart(face); bits != 0; bits &= bits - 1) {
        const std::size_t i = g * FacePlanes::kLanes + static_cast<std::size_t>(__builtin_ctz(bits));
        if (boxes[i].meets(box)) found += guarded_meet(faces[i], face, moved_);
      }
    }
  };
  // What waits for memory is most of the cost: faces, then their corners, are asked for some steps ahead.
  std::array<std::uint32_t, 32> near;
  std::size_t waiting = 0;
  const auto test_waiting = [&] {
    constexpr std::size_t kAhead = 4;
    for (std::size_t i = 0; i < std::min(kAhead, waiting); ++i) prefetch_corners(near[i]);
    for (std::size_t i = 0; i < waiting && found < enough; ++i) {
      if (i + kAhead < waiting) prefetch_corners(near[i + kAhead]);
      test(near[i]);
    }
    waiting = 0;
    return found < enough;
  };
  boxes_.for_meeting(all, [&](std::uint32_t other) {
    __builtin_prefetch(&mesh_.face(other));
    near[waiting++] = other;
    return waiting < near.size() || test_waiting();
  });
  test_waiting();
  if (found >= enough || outline.tiled_by(faces)) return found;
  for (std::size_t i = 0; i < faces.size(); ++i)
    for (std::size_t j = 0; j < i; ++j) found += guarded_meet(faces[i], faces[j], moved_);
  return found;
}

bool CrossingGuard::adds(const Outline& outline) {
  made_meet_ = false;
  if (made_.empty()) return false;
  if (!built_) build();
  // Nearly always there are none at all: what was there before is looked at only then.
  find_boxes(made_, made_box_);
  if (contacts(made_, made_box_, outline, 1) == 0) return false;
  made_meet_ = true;
  before_.clear();
  for (const std::uint32_t f : gone_) before_.push_back(contact_face(f));
  find_boxes(before_, before_box_);
  const std::uint64_t moved = std::exchange(moved_, kNobody);
  const std::size_t before = contacts(before_, before_box_, Outline(mesh_, {}), kAll);
  moved_ = moved;
  return before == 0 || contacts(made_, made_box_, outline, before + 1) > before;
}

std::size_t count_contacts(const CollapseMesh& mesh) {
  MeshBlock block;
  block.position.reserve(mesh.vertices());
  for (std::uint32_t v = 0; v < mesh.vertices(); ++v) block.position.push_back(mesh.at(v));
  for (const CollapseFace& f : mesh.faces())
    if ((f.state & kStateDead) == 0) block.faces.push_back({f.vertex[0], f.vertex[1], f.vertex[2]});
  return count_contacts(block);
}

}  // namespace tessera

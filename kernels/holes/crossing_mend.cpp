#include "kernels/holes/crossing_mend.h"

#include <algorithm>
#include <array>
#include <map>
#include <optional>
#include <utility>

#include "kernels/holes/border_retreat.h"
#include "kernels/holes/hole_filling.h"
#include "kernels/holes/hole_triangulation.h"
#include "kernels/holes/mend_region.h"
#include "kernels/mesh/mesh_block_ops.h"
#include "kernels/mesh/orientation_sign.h"

namespace tessera {
namespace {

constexpr std::size_t kMaxCut = 60;  ///< faces that may go at a border
constexpr int kCutRings = 2;         ///< around the faces of pairs, where a part at a border goes
constexpr std::uint32_t kNoFace = MendRegion::kNoFace;

using Corners = MendRegion::Corners;
using Edge = MendRegion::Edge;
using Disk = MendDisk;

/// Faces of one disk anew. Numbers of vertices from those of the block on are new ones.
struct DiskFilling {
  std::vector<Corners> faces;
  std::vector<Double3> position;
  std::vector<std::uint32_t> rgba;
};

class CrossingMender {
 public:
  CrossingMender(const MeshBlock& block, std::span<const std::uint32_t> crossing, const ContactCell& whole,
                 const CrossingMendOptions& options)
      : block_(block), crossing_(crossing), options_(options), around_(block, whole) {}

  CrossingMend run() {
    if (options_.gentle && (retreat() || waits())) return std::move(out_);
    std::vector<std::uint32_t> region(crossing_.begin(), crossing_.end());
    for (int ring = 0; ring <= options_.max_rings; ++ring) {
      if (ring > 0) around_.grow(region);
      if (region.size() > options_.max_faces || is_torn(region)) break;
      if (fill(region)) return std::move(out_);
      if (waits()) break;
    }
    if (!waits() && retreat()) return std::move(out_);
    if (!waits() && options_.may_cut) {
      region.assign(crossing_.begin(), crossing_.end());
      for (int ring = 0; ring <= kCutRings; ++ring) {
        if (ring > 0) around_.grow(region);
        if (!around_.is_known(region) || region.size() > options_.max_faces) break;
        if (cut(region)) break;
      }
    }
    return std::move(out_);
  }

 private:
  std::span<const std::uint32_t> faces_at(std::uint32_t v) const { return around_.faces_at(v); }
  const Corners& corners(std::uint32_t f) const { return block_.faces[f]; }
  static Edge edge(const Corners& f, std::size_t k) { return MendRegion::edge(f, k); }
  std::uint32_t across(std::uint32_t f, const Edge& e) const { return around_.across(f, e); }
  std::uint32_t apex(std::uint32_t f, const Edge& e) const {
    for (const std::uint32_t v : corners(f))
      if (v != e[0] && v != e[1]) return v;
    return e[0];
  }

  /// Too little is here, and a wider block may come.
  bool waits() const { return out_.torn && !options_.last_block; }
  bool is_torn(const std::vector<std::uint32_t>& region) {
    const bool torn = !around_.is_known(region);
    out_.torn = out_.torn || torn;
    return torn;
  }

  // Fillings.

  HoleLoop hole_of(const Disk& disk, const std::vector<std::uint32_t>& region) const {
    HoleLoop hole;
    const Double3 origin = block_.position[disk.loop[0]];
    const std::size_t n = disk.loop.size();
    // Both vertices of a bridge to a hole are in the loop twice.
    std::multimap<std::uint32_t, std::uint32_t> number;
    for (std::uint32_t i = 0; i < n; ++i) number.emplace(disk.loop[i], i);
    const auto take = [&](std::uint32_t one, std::uint32_t other) {
      const auto [first, last] = number.equal_range(one);
      const auto [begin, end] = number.equal_range(other);
      for (auto a = first; a != last; ++a)
        for (auto b = begin; b != end; ++b) {
          const auto [low, high] = std::minmax(a->second, b->second);
          if (high - low > 1 && high - low + 1 < n) hole.taken.push_back({low, high});
        }
    };
    for (std::size_t i = 0; i < n; ++i) {
      const Edge e = {disk.loop[i], disk.loop[(i + 1) % n]};
      hole.position.push_back(block_.position[e[0]] - origin);
      if (!block_.rgba.empty()) hole.rgba.push_back(block_.rgba[e[0]]);
      // Beside a border there is nothing: the corner itself gives no normal.
      std::uint32_t third = e[0];
      for (const std::uint32_t f : faces_at(e[0])) {
        if (std::binary_search(region.begin(), region.end(), f)) continue;
        for (std::size_t k = 0; k < 3; ++k) {
          const Edge of = edge(corners(f), k);
          if (of == Edge{e[1], e[0]}) third = apex(f, of);
          take(of[0], of[1]);
        }
      }
      hole.opposite.push_back(block_.position[third] - origin);
      if (number.count(e[0]) > 1) take(e[0], e[0]);
      if (number.count(e[0]) + number.count(e[1]) > 2) take(e[0], e[1]);
    }
    sort_unique(hole.taken);
    return hole;
  }

  /// \param fair  a patch with vertices of its own; else the outline's triangulation
  std::optional<DiskFilling> filling_of(const Disk& disk, const HoleLoop& hole, bool fair,
                                        std::size_t first_new) const {
    DiskFilling out;
    const std::size_t n = disk.loop.size();
    std::vector<Corners> faces;
    if (fair) {
      HoleFilling filled = fill_hole(hole);
      if (filled.outcome != HoleOutcome::kFilled) return std::nullopt;
      faces = std::move(filled.faces);
      out.rgba = std::move(filled.rgba);
      for (const Double3& p : filled.position) {
        Double3 at = p + block_.position[disk.loop[0]];
        if (options_.float_positions)
          for (double& x : at) x = static_cast<double>(static_cast<float>(x));
        out.position.push_back(at);
      }
    } else {
      faces = triangulate_hole(hole, boundary_normals(hole)).faces;
    }
    if (faces.empty()) return std::nullopt;
    for (Corners f : faces) {
      for (std::uint32_t& v : f) v = v < n ? disk.loop[v] : static_cast<std::uint32_t>(first_new + v - n);
      out.faces.push_back(f);
    }
    return out;
  }

  Double3 place_of(std::uint32_t v, const std::vector<Double3>& fresh) const {
    const std::size_t n = block_.position.size();
    const Double3& p = v < n ? block_.position[v] : fresh[v - n];
    return options_.written ? options_.written(p) : p;
  }
  ContactFace contact_of(const Corners& f, const std::vector<Double3>& fresh) const {
    return {{place_of(f[0], fresh), place_of(f[1], fresh), place_of(f[2], fresh)}, {f[0], f[1], f[2]}};
  }

  /// Whether some faces meet nothing: neither each other nor what stays of the block.
  /// \param region  what does not stay, ascending
  bool is_clear(const std::vector<Corners>& faces, const std::vector<Double3>& fresh,
                const std::vector<std::uint32_t>& region) {
    std::vector<ContactFace> all;
    ContactCell box = {{kInfinite, kInfinite, kInfinite}, {-kInfinite, -kInfinite, -kInfinite}};
    for (const Corners& f : faces) {
      all.push_back(contact_of(f, fresh));
      const ContactFace& c = all.back();
      if (collinear(c.corner[0], c.corner[1], c.corner[2])) return false;
      for (const std::uint32_t v : f) {
        const Double3& p =
            v < block_.position.size() ? block_.position[v] : fresh[v - block_.position.size()];
        if (!around_.is_within(p)) {
          out_.torn = true;
          return false;
        }
      }
      for (const Double3& p : c.corner)
        for (std::size_t a = 0; a < 3; ++a)
          box.low[a] = std::min(box.low[a], p[a]), box.high[a] = std::max(box.high[a], p[a]);
    }
    const std::size_t own = all.size();
    for (std::uint32_t f = 0; f < block_.faces.size(); ++f) {
      if (std::binary_search(region.begin(), region.end(), f)) continue;
      const ContactFace c = contact_of(corners(f), fresh);
      bool apart = false;
      for (std::size_t a = 0; a < 3; ++a)
        apart = apart || std::min({c.corner[0][a], c.corner[1][a], c.corner[2][a]}) > box.high[a] ||
                std::max({c.corner[0][a], c.corner[1][a], c.corner[2][a]}) < box.low[a];
      if (!apart && !collinear(c.corner[0], c.corner[1], c.corner[2])) all.push_back(c);
    }
    bool clear = true;
    block_contacts(all, kAllSpace, [&](std::uint32_t i, std::uint32_t j, FaceContact) {
      clear = clear && ((i >= own && j >= own) || meet_in_copies(all[i], all[j]));
    });
    return clear;
  }

  /// Inner edges of fillings lie in one of them alone.
  static bool are_apart(const std::vector<Corners>& faces) {
    std::map<Edge, int> runs;
    for (const Corners& f : faces)
      for (std::size_t k = 0; k < 3; ++k)
        if (++runs[edge(f, k)] > 1) return false;
    return true;
  }

  bool fill(std::vector<std::uint32_t> region) {
    const auto disks = around_.disks_of(region, options_.max_faces, options_.max_loop);
    if (!disks) return false;
    std::vector<Corners> faces;
    std::vector<Double3> fresh;
    std::vector<std::uint32_t> rgba;
    std::vector<std::size_t> ends;  // of the faces of each disk
    for (const Disk& disk : *disks) {
      const HoleLoop hole = hole_of(disk, region);
      bool found = false;
      for (const bool fair : {false, true}) {
        const auto some = filling_of(disk, hole, fair, block_.position.size() + fresh.size());
        if (!some) continue;
        std::vector<Double3> with = fresh;
        with.insert(with.end(), some->position.begin(), some->position.end());
        std::vector<Corners> so_far = faces;
        so_far.insert(so_far.end(), some->faces.begin(), some->faces.end());
        if (!are_apart(so_far) || !is_clear(so_far, with, region)) continue;
        faces = std::move(so_far), fresh = std::move(with);
        rgba.insert(rgba.end(), some->rgba.begin(), some->rgba.end());
        found = true;
        break;
      }
      if (!found) return false;
      ends.push_back(faces.size());
    }
    hand_out(region, *disks, faces, ends, fresh, rgba);
    return true;
  }

  /// Bits of the flags that an edge of a new face has from the face that was there.
  std::uint8_t border_flags(const Corners& f, const Disk& disk) const {
    unsigned flags = 0;
    for (std::size_t k = 0; k < 3; ++k) {
      const Edge e = edge(f, k);
      if (e[0] >= block_.key.size()) continue;
      for (const std::uint32_t g : faces_at(e[0]))
        if (std::binary_search(disk.faces.begin(), disk.faces.end(), g))
          for (std::size_t m = 0; m < 3; ++m)
            if (edge(corners(g), m) == e && (block_.face_flags[g] & (kFaceBorder01 << m)) != 0)
              flags |= static_cast<unsigned>(kFaceBorder01) << k;
    }
    for (const std::uint32_t g : disk.faces) flags |= block_.face_flags[g] & kFaceSynthetic;
    return static_cast<std::uint8_t>(flags);
  }

  void hand_out(const std::vector<std::uint32_t>& region, const std::vector<Disk>& disks,
                const std::vector<Corners>& faces, const std::vector<std::size_t>& ends,
                const std::vector<Double3>& fresh, const std::vector<std::uint32_t>& rgba) {
    begin_added(fresh, rgba);
    for (std::size_t d = 0, f = 0; d < disks.size(); ++d) {
      float bound = 0.0f;
      for (const std::uint32_t g : disks[d].faces)
        if (!block_.face_bound.empty()) bound = std::max(bound, block_.face_bound[g]);
      for (; f < ends[d]; ++f) add(faces[f], border_flags(faces[f], disks[d]), bound);
    }
    out_.removed = region;
    finish_added();
  }

  void begin_added(const std::vector<Double3>& fresh, const std::vector<std::uint32_t>& rgba) {
    MeshBlock& added = out_.added;
    added = {};
    added.key = block_.key;
    added.position = block_.position;
    added.vertex_class = block_.vertex_class;
    added.rgba = block_.rgba;
    for (std::size_t v = 0; v < fresh.size(); ++v) {
      added.key.push_back(options_.first_key + v);
      added.position.push_back(fresh[v]);
      added.vertex_class.push_back(VertexClass::kSmooth);
    }
    if (!block_.rgba.empty()) added.rgba.insert(added.rgba.end(), rgba.begin(), rgba.end());
    out_.new_vertices = fresh.size();
  }
  void add(const Corners& f, std::uint8_t flags, float bound) {
    out_.added.faces.push_back(f);
    out_.added.face_flags.push_back(flags);
    if (!block_.face_bound.empty()) out_.added.face_bound.push_back(bound);
  }
  void finish_added() {
    if (!out_.added.faces.empty())
      canonicalise(out_.added);
    else
      out_.added = {};
    out_.mended = true;
  }

  /// Vertices of crossing faces at a border go inwards, those of one part alone before all: where two sheets end beside each other,
  /// one pokes into the other no deeper than that.
  bool retreat() {
    std::vector<std::vector<std::uint32_t>> sets;
    std::vector<std::uint32_t> all;
    for (const std::vector<std::uint32_t>& part : around_.parts_of({crossing_.begin(), crossing_.end()})) {
      if (is_torn(part)) return false;
      sets.push_back(border_vertices(block_, part));
      all.insert(all.end(), sets.back().begin(), sets.back().end());
    }
    sort_unique(all);
    sets.push_back(std::move(all));
    for (double share = 1.0 / 64.0; share <= 0.5; share *= 2.0)
      for (const auto& set : sets)
        if (!set.empty() && pull_in(set, share)) return true;
    return false;
  }

  bool pull_in(const std::vector<std::uint32_t>& set, double share) {
    const BorderRetreat to = pulled_in(block_, set, share, options_.float_positions);
    if (is_torn(to.faces)) return false;
    std::vector<Corners> tested = to.corners;
    std::vector<std::uint32_t> without = to.faces;
    for (const std::uint32_t f : crossing_)
      if (!std::binary_search(to.faces.begin(), to.faces.end(), f))
        tested.push_back(corners(f)), without.push_back(f);
    sort_unique(without);
    if (to.turns || !is_clear(tested, to.position, without)) return false;
    begin_added(to.position, to.rgba);
    for (std::size_t i = 0; i < to.faces.size(); ++i)
      add(to.corners[i], block_.face_flags[to.faces[i]],
          block_.face_bound.empty() ? 0.0f : block_.face_bound[to.faces[i]]);
    out_.removed = to.faces;
    finish_added();
    return true;
  }

  // Cuts.

  /// What stays of the faces around a vertex is one fan.
  bool has_one_fan(std::uint32_t v, const std::vector<std::uint32_t>& gone) const {
    std::vector<std::uint32_t> left;
    for (const std::uint32_t f : faces_at(v))
      if (!std::binary_search(gone.begin(), gone.end(), f)) left.push_back(f);
    if (left.size() < 2) return true;
    std::vector<std::uint32_t> fan = {left[0]};
    for (std::size_t i = 0; i < fan.size(); ++i)
      for (const std::uint32_t w : corners(fan[i])) {
        if (w == v) continue;
        for (const std::uint32_t g : left)
          if (std::find(fan.begin(), fan.end(), g) == fan.end() &&
              std::find(corners(g).begin(), corners(g).end(), w) != corners(g).end())
            fan.push_back(g);
      }
    return fan.size() == left.size();
  }

  /// One part at a border after the other, then all of them.
  bool cut(const std::vector<std::uint32_t>& region) {
    std::vector<std::uint32_t> all;
    std::size_t parts = 0;
    for (const std::vector<std::uint32_t>& part : around_.parts_of(region)) {
      const bool at_border = std::any_of(part.begin(), part.end(), [&](std::uint32_t f) {
        for (std::size_t k = 0; k < 3; ++k)
          if (across(f, edge(corners(f), k)) == kNoFace) return true;
        return false;
      });
      if (!at_border) continue;
      if (cut_out(part)) return true;
      all.insert(all.end(), part.begin(), part.end());
      ++parts;
    }
    sort_unique(all);
    return parts > 1 && cut_out(all);
  }

  /// With what else hangs on single vertices then.
  bool cut_out(std::vector<std::uint32_t> gone) {
    for (bool whole = false; !whole;) {
      if (gone.size() > kMaxCut || !around_.is_known(gone)) return false;
      std::vector<std::uint32_t> more;
      for (const std::uint32_t f : gone)
        for (const std::uint32_t v : corners(f))
          if (!has_one_fan(v, gone)) more.insert(more.end(), faces_at(v).begin(), faces_at(v).end());
      whole = more.empty();
      gone.insert(gone.end(), more.begin(), more.end());
      sort_unique(gone);
    }
    std::vector<Corners> left;
    for (const std::uint32_t f : crossing_)
      if (!std::binary_search(gone.begin(), gone.end(), f)) left.push_back(corners(f));
    std::vector<std::uint32_t> without = gone;
    without.insert(without.end(), crossing_.begin(), crossing_.end());
    sort_unique(without);
    if (!left.empty() && !is_clear(left, {}, without)) return false;
    begin_added({}, {});
    out_.removed = gone;
    std::vector<std::uint32_t> beside;
    for (const std::uint32_t f : gone)
      for (std::size_t k = 0; k < 3; ++k)
        if (const std::uint32_t g = across(f, edge(corners(f), k));
            g != kNoFace && !std::binary_search(gone.begin(), gone.end(), g))
          beside.push_back(g);
    sort_unique(beside);
    for (const std::uint32_t g : beside) {
      unsigned flags = block_.face_flags[g];
      for (std::size_t k = 0; k < 3; ++k)
        if (const std::uint32_t f = across(g, edge(corners(g), k));
            f != kNoFace && std::binary_search(gone.begin(), gone.end(), f))
          flags |= static_cast<unsigned>(kFaceBorder01) << k;
      add(corners(g), static_cast<std::uint8_t>(flags),
          block_.face_bound.empty() ? 0.0f : block_.face_bound[g]);
      out_.removed.push_back(g);
    }
    sort_unique(out_.removed);
    finish_added();
    return true;
  }

  static constexpr double kInfinite = std::numeric_limits<double>::infinity();

  const MeshBlock& block_;
  std::span<const std::uint32_t> crossing_;
  const CrossingMendOptions& options_;
  const MendRegion around_;
  CrossingMend out_;
};

}  // namespace

CrossingMend mend_crossing(const MeshBlock& block, std::span<const std::uint32_t> crossing,
                           const ContactCell& whole, const CrossingMendOptions& options) {
  if (crossing.empty()) return {};
  return CrossingMender(block, crossing, whole, options).run();
}

std::uint64_t crossing_mend_bytes(std::uint64_t faces, const CrossingMendOptions& options) {
  return faces * (sizeof(ContactFace) + 104) + block_contacts_bytes(faces) + hole_bytes(options.max_loop) +
         std::uint64_t{options.max_faces} * 400;
}

}  // namespace tessera

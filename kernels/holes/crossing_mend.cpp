#include "kernels/holes/crossing_mend.h"

#include <algorithm>
#include <array>
#include <map>
#include <optional>
#include <set>
#include <utility>

#include "kernels/holes/border_retreat.h"
#include "kernels/holes/hole_filling.h"
#include "kernels/holes/hole_triangulation.h"
#include "kernels/mesh/mesh_block_ops.h"
#include "kernels/mesh/orientation_sign.h"

namespace tessera {
namespace {

constexpr std::size_t kMaxIsland = 200;  ///< faces within a ring that are taken out with it
constexpr std::size_t kMaxCut = 60;      ///< faces that may go at a border
constexpr int kCutRings = 2;             ///< around the faces of pairs, where a part at a border goes
constexpr std::uint32_t kNoFace = ~std::uint32_t{0};

using Corners = std::array<std::uint32_t, 3>;
using Edge = std::array<std::uint32_t, 2>;  ///< from, to

/// Faces that were taken out and hang together, and their outline as a filling runs along it.
struct Disk {
  std::vector<std::uint32_t> faces;  ///< ascending
  std::vector<std::uint32_t> loop;   ///< vertices, the smallest first
};

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
      : block_(block), crossing_(crossing), whole_(whole), options_(options) {
    start_.assign(block.key.size() + 1, 0);
    for (const Corners& f : block.faces)
      for (const std::uint32_t v : f) ++start_[v + std::size_t{1}];
    for (std::size_t v = 1; v < start_.size(); ++v) start_[v] += start_[v - 1];
    at_.resize(3 * block.faces.size());
    std::vector<std::uint32_t> next(start_.begin(), start_.end() - 1);
    for (std::uint32_t f = 0; f < block.faces.size(); ++f)
      for (const std::uint32_t v : block.faces[f]) at_[next[v]++] = f;
  }

  CrossingMend run() {
    out_region_.assign(block_.faces.size(), 0);
    std::vector<std::uint32_t> region(crossing_.begin(), crossing_.end());
    for (int ring = 0; ring <= options_.max_rings; ++ring) {
      if (ring > 0) grow(region);
      if (region.size() > options_.max_faces) break;
      if (!is_known(region)) {
        out_.torn = true;
        break;
      }
      if (fill(region)) return std::move(out_);
      if (out_.torn) break;
    }
    if (!out_.torn && retreat()) return std::move(out_);
    if (!out_.torn && options_.may_cut) {
      region.assign(crossing_.begin(), crossing_.end());
      for (int ring = 0; ring <= kCutRings; ++ring) {
        if (ring > 0) grow(region);
        if (!is_known(region) || region.size() > options_.max_faces) break;
        if (cut(region)) break;
      }
    }
    return std::move(out_);
  }

 private:
  std::span<const std::uint32_t> faces_at(std::uint32_t v) const {
    return {at_.data() + start_[v], start_[v + std::size_t{1}] - start_[v]};
  }
  const Corners& corners(std::uint32_t f) const { return block_.faces[f]; }
  static Edge edge(const Corners& f, std::size_t k) { return {f[k], f[(k + 1) % 3]}; }
  std::uint32_t apex(std::uint32_t f, const Edge& e) const {
    for (const std::uint32_t v : corners(f))
      if (v != e[0] && v != e[1]) return v;
    return e[0];
  }

  /// The face across an edge, whichever way it runs; kNoFace at a border.
  std::uint32_t across(std::uint32_t f, const Edge& e) const {
    for (const std::uint32_t g : faces_at(e[0]))
      if (g != f)
        for (const std::uint32_t v : corners(g))
          if (v == e[1]) return g;
    return kNoFace;
  }

  void grow(std::vector<std::uint32_t>& region) const {
    std::vector<std::uint32_t> grown;
    for (const std::uint32_t f : region)
      for (const std::uint32_t v : corners(f))
        for (const std::uint32_t g : faces_at(v)) grown.push_back(g);
    tidy(grown);
    region = std::move(grown);
  }
  template <class T>
  static void tidy(std::vector<T>& list) {
    std::sort(list.begin(), list.end());
    list.erase(std::unique(list.begin(), list.end()), list.end());
  }

  bool is_within(const Double3& p) const {
    for (std::size_t a = 0; a < 3; ++a)
      if (!(p[a] > whole_.low[a] && p[a] < whole_.high[a])) return false;
    return true;
  }
  /// All faces at the corners are here: an edge of one face is a border.
  bool is_known(const std::vector<std::uint32_t>& region) const {
    for (const std::uint32_t f : region)
      for (const std::uint32_t v : corners(f))
        if (!is_within(block_.position[v])) return false;
    return true;
  }

  // Parts.

  /// Faces that share edges, part by part, in the order of their first faces.
  std::vector<std::vector<std::uint32_t>> parts_of(const std::vector<std::uint32_t>& region) {
    for (const std::uint32_t f : region) out_region_[f] = 1;
    std::vector<std::vector<std::uint32_t>> parts;
    for (const std::uint32_t first : region) {
      if (out_region_[first] != 1) continue;
      std::vector<std::uint32_t> part = {first};
      out_region_[first] = 2;
      for (std::size_t i = 0; i < part.size(); ++i)
        for (std::size_t k = 0; k < 3; ++k) {
          const std::uint32_t g = across(part[i], edge(corners(part[i]), k));
          if (g != kNoFace && out_region_[g] == 1) out_region_[g] = 2, part.push_back(g);
        }
      std::sort(part.begin(), part.end());
      parts.push_back(std::move(part));
    }
    for (const std::uint32_t f : region) out_region_[f] = 0;
    return parts;
  }

  /// Loops of directed edges beside which the part ends; none where they meet in a vertex.
  std::optional<std::vector<std::vector<std::uint32_t>>> loops_of(
      const std::vector<std::uint32_t>& part) const {
    std::map<std::uint32_t, std::uint32_t> next;
    for (const std::uint32_t f : part)
      for (std::size_t k = 0; k < 3; ++k) {
        const Edge e = edge(corners(f), k);
        const std::uint32_t g = across(f, e);
        if (g != kNoFace && std::binary_search(part.begin(), part.end(), g)) continue;
        if (!next.emplace(e[0], e[1]).second) return std::nullopt;
      }
    std::vector<std::vector<std::uint32_t>> loops;
    while (!next.empty()) {
      std::vector<std::uint32_t> loop;
      for (auto at = next.begin(); at != next.end(); at = next.find(loop.back())) {
        if (loop.empty()) loop.push_back(at->first);
        loop.push_back(at->second);
        next.erase(at);
      }
      if (loop.front() != loop.back()) return std::nullopt;
      loop.pop_back();
      loops.push_back(std::move(loop));
    }
    return loops;
  }

  /// The faces beyond a loop, where they are few and nothing else hangs on them.
  std::vector<std::uint32_t> island_beyond(const std::vector<std::uint32_t>& loop,
                                           const std::vector<std::uint32_t>& part) const {
    std::vector<std::uint32_t> island;
    std::set<std::uint32_t> seen;
    const auto add = [&](std::uint32_t g) {
      if (g != kNoFace && !std::binary_search(part.begin(), part.end(), g) && seen.insert(g).second)
        island.push_back(g);
    };
    for (std::size_t i = 0; i < loop.size(); ++i) {
      const Edge e = {loop[i], loop[(i + 1) % loop.size()]};
      for (const std::uint32_t f : faces_at(e[0]))
        for (const std::uint32_t v : corners(f))
          if (v == e[1]) add(f);
    }
    for (std::size_t i = 0; i < island.size(); ++i) {
      if (island.size() > kMaxIsland) return {};
      for (std::size_t k = 0; k < 3; ++k) {
        const Edge e = edge(corners(island[i]), k);
        if (!is_within(block_.position[e[0]])) return {};
        add(across(island[i], e));
      }
    }
    return island;
  }

  /// The parts as disks, with the islands in them; none where that is not what they are.
  std::optional<std::vector<Disk>> disks_of(std::vector<std::uint32_t>& region) {
    for (int again = 0; again < 4; ++again) {
      std::vector<Disk> disks;
      bool widened = false;
      for (const std::vector<std::uint32_t>& part : parts_of(region)) {
        auto loops = loops_of(part);
        if (!loops || loops->empty()) return std::nullopt;
        if (loops->size() > 1) {
          std::size_t open = 0;
          std::vector<std::uint32_t> taken;
          for (const auto& loop : *loops) {
            const std::vector<std::uint32_t> island = island_beyond(loop, part);
            open += island.empty();
            taken.insert(taken.end(), island.begin(), island.end());
          }
          if (open != 1) return std::nullopt;
          region.insert(region.end(), taken.begin(), taken.end());
          widened = true;
          continue;
        }
        Disk disk{part, std::move(loops->front())};
        if (!is_disk(disk) || disk.loop.size() > options_.max_loop) return std::nullopt;
        std::rotate(disk.loop.begin(), std::min_element(disk.loop.begin(), disk.loop.end()), disk.loop.end());
        disks.push_back(std::move(disk));
      }
      if (!widened) return disks;
      tidy(region);
      if (region.size() > options_.max_faces || !is_known(region)) return std::nullopt;
    }
    return std::nullopt;
  }

  /// By Euler's number: vertices - edges + faces is 1.
  bool is_disk(const Disk& disk) const {
    std::vector<std::uint32_t> vertices;
    for (const std::uint32_t f : disk.faces)
      for (const std::uint32_t v : corners(f)) vertices.push_back(v);
    tidy(vertices);
    return 2 * vertices.size() + 2 * disk.faces.size() == 3 * disk.faces.size() + disk.loop.size() + 2;
  }

  // Fillings.

  HoleLoop hole_of(const Disk& disk, const std::vector<std::uint32_t>& region) const {
    HoleLoop hole;
    const Double3 origin = block_.position[disk.loop[0]];
    const std::size_t n = disk.loop.size();
    std::map<std::uint32_t, std::uint32_t> number;
    for (std::uint32_t i = 0; i < n; ++i) number[disk.loop[i]] = i;
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
          const auto a = number.find(of[0]), b = number.find(of[1]);
          if (a == number.end() || b == number.end()) continue;
          const auto [low, high] = std::minmax(a->second, b->second);
          if (high - low > 1 && high - low + 1 < n) hole.taken.push_back({low, high});
        }
      }
      hole.opposite.push_back(block_.position[third] - origin);
    }
    tidy(hole.taken);
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
        if (!is_within(p)) {
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
    const auto disks = disks_of(region);
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
    for (const std::vector<std::uint32_t>& part : parts_of({crossing_.begin(), crossing_.end()})) {
      if (!is_known(part)) return !(out_.torn = true);
      sets.push_back(border_vertices(block_, part));
      all.insert(all.end(), sets.back().begin(), sets.back().end());
    }
    tidy(all);
    sets.push_back(std::move(all));
    for (double share = 1.0 / 64.0; share <= 0.5; share *= 2.0)
      for (const auto& set : sets)
        if (!set.empty() && pull_in(set, share)) return true;
    return false;
  }

  bool pull_in(const std::vector<std::uint32_t>& set, double share) {
    const BorderRetreat to = pulled_in(block_, set, share, options_.float_positions);
    if (!is_known(to.faces)) return !(out_.torn = true);
    std::vector<Corners> tested = to.corners;
    std::vector<std::uint32_t> without = to.faces;
    for (const std::uint32_t f : crossing_)
      if (!std::binary_search(to.faces.begin(), to.faces.end(), f))
        tested.push_back(corners(f)), without.push_back(f);
    tidy(without);
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
    for (const std::vector<std::uint32_t>& part : parts_of(region)) {
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
    tidy(all);
    return parts > 1 && cut_out(all);
  }

  /// With what else hangs on single vertices then.
  bool cut_out(std::vector<std::uint32_t> gone) {
    for (bool whole = false; !whole;) {
      if (gone.size() > kMaxCut || !is_known(gone)) return false;
      std::vector<std::uint32_t> more;
      for (const std::uint32_t f : gone)
        for (const std::uint32_t v : corners(f))
          if (!has_one_fan(v, gone)) more.insert(more.end(), faces_at(v).begin(), faces_at(v).end());
      whole = more.empty();
      gone.insert(gone.end(), more.begin(), more.end());
      tidy(gone);
    }
    std::vector<Corners> left;
    for (const std::uint32_t f : crossing_)
      if (!std::binary_search(gone.begin(), gone.end(), f)) left.push_back(corners(f));
    std::vector<std::uint32_t> without = gone;
    without.insert(without.end(), crossing_.begin(), crossing_.end());
    tidy(without);
    if (!left.empty() && !is_clear(left, {}, without)) return false;
    begin_added({}, {});
    out_.removed = gone;
    std::vector<std::uint32_t> beside;
    for (const std::uint32_t f : gone)
      for (std::size_t k = 0; k < 3; ++k)
        if (const std::uint32_t g = across(f, edge(corners(f), k));
            g != kNoFace && !std::binary_search(gone.begin(), gone.end(), g))
          beside.push_back(g);
    tidy(beside);
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
    tidy(out_.removed);
    finish_added();
    return true;
  }

  static constexpr double kInfinite = std::numeric_limits<double>::infinity();

  const MeshBlock& block_;
  std::span<const std::uint32_t> crossing_;
  const ContactCell& whole_;
  const CrossingMendOptions& options_;
  std::vector<std::uint32_t> start_, at_;  ///< faces at each vertex
  std::vector<std::uint8_t> out_region_;   ///< scratch of parts_of(): 0 but while it works
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

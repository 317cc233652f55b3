/// \file remesher.h
/// The loop of remesh() over a corner table. See remesh.h.
#pragma once
#include <array>
#include <utility>
#include <vector>

#include "kernels/decimate/collapse_legality.h"
#include "kernels/decimate/collapse_mesh.h"
#include "kernels/decimate/crossing_guard.h"
#include "kernels/remesh/covered_points.h"
#include "kernels/remesh/edge_ratios.h"
#include "kernels/remesh/reference_surface.h"
#include "kernels/remesh/remesh.h"

namespace tessera {

/// No step leaves a face flatter than so many times what counts as flat: room for the rounding of what is written.
inline constexpr double kFlatRoom = 4.0;

class Remesher {
 public:
  /// \param mesh     of `block`, creases marked \param origin  of both \param surface  with the same one
  /// \param guarded  refuse what would make faces cross; where the tolerance asks for splits these are not looked at
  Remesher(CollapseMesh& mesh, const MeshBlock& block, const Double3& origin, const ReferenceSurface& surface,
           const RemeshOptions& options, std::span<const std::uint64_t> pinned, bool guarded);
  void run(RemeshReport& report);

  [[nodiscard]] std::uint64_t key(std::uint32_t v) const { return info_[v].key; }
  [[nodiscard]] bool moved(std::uint32_t v) const { return info_[v].moved; }
  [[nodiscard]] std::uint32_t foot(std::uint32_t v) const { return info_[v].foot; }

 private:
  struct Info {
    std::uint64_t key = 0;
    Float3 normal{};  ///< of the reference at the foot; zero on lines and where unknown
    std::uint32_t foot = ReferenceSurface::kNone;  ///< slot of a face; on lines a segment
    float target = 0.0f;                           ///< length of edges here
    // Bits: there are many of these.
    bool pinned : 1 = false;   ///< its faces stay
    bool moved : 1 = false;    ///< or new
    bool line : 1 = false;     ///< on a crease or border, not a corner
    bool lasting : 1 = false;  ///< ReferenceSurface::lasting_corners()
    bool whole : 1 = true;     ///< all its faces are in the block
  };
  /// An edge by the corner opposite it, and how long it is.
  struct Edge {
    std::uint32_t length_class, corner;
    std::uint32_t a, b;  ///< vertices
  };
  using Refusal = CollapseRefusal;
  /// In units of the target: edges below `shortest` collapse where none gets longer than `longest`.
  struct CollapseLengths {
    double shortest, longest;
  };
  /// A face as it would be.
  struct NewFace {
    std::uint32_t vertex[3];
    Double3 at[3];
  };

  /// Before every edge, face or vertex that is worked on.
  void step() const {
    if ((++steps_ & 0xfffu) == 0 && options_.pause) options_.pause();
  }
  static void count(Refusal refusal, RemeshReport& report);
  /// Where no split comes in between, the guard knows all faces.
  void begin_guarding() {
    if (guarded_) guard_.renew(FaceBoxes::Order::kMorton);
  }
  /// Whether what would make faces meet is refused: not any more once it took too long to see.
  bool guarding() {
    if (guarded_ && guard_.looked_at() > kMaxLooks * info_.size()) guarded_ = false, guard_spent_ = true;
    return guarded_;
  }
  /// Where a vertex is put. Guarded, it lies where the output will hold it: sheets nearer to each other than floats are would meet in what is written.
  [[nodiscard]] Double3 as_put(const Double3& p) const {
    return guarded_ && options_.float_positions ? wide(narrow(origin_ + p)) - origin_ : p;
  }
  bool is_hopeless(const RemeshReport& report) const;
  void set_lines();
  void find_feet(const std::vector<std::uint32_t>& own);
  Edge edge_at(std::uint32_t c) const;
  void make_room_in_list();
  void sort_listed(bool longest_first);
  template <class Wanted>
  void list_edges(const Wanted& wanted, bool longest_first);
  bool current(const Edge& e) const;
  double square_of(std::uint32_t a, std::uint32_t b) const {
    return squared_distance(mesh_.at(a), mesh_.at(b));
  }
  double target(std::uint32_t a, std::uint32_t b) const { return std::min(info_[a].target, info_[b].target); }
  void mark_changed(std::uint32_t v) { changed_[v] = static_cast<std::uint8_t>(round_ + 1); }
  bool is_line(std::uint32_t c) const { return mesh_.crease_edge(c) || mesh_.border_edge(c); }

  void split_long(int rounds, RemeshReport& report);
  bool too_long(std::uint32_t a, std::uint32_t b) const;
  bool has_longer_neighbour(const Edge& e) const;
  bool split_if_free(const Edge& e, RemeshReport& report);
  bool is_split_sound(std::uint32_t c, const Double3& at) const;
  bool too_thin_to_split(std::uint32_t c) const;
  Double3 split_place(const Edge& e, Info& info) const;
  bool split(const Edge& e);
  void refine(RemeshReport& report);
  bool is_as_before(const CollapseFace& face) const;
  void want_beyond(std::vector<std::uint8_t>& wanted) const;
  void want_missed(std::vector<Double3>& points, std::vector<std::uint8_t>& wanted) const;
  std::size_t split_wanted(const std::vector<std::uint8_t>& wanted, RemeshReport& report);
  std::uint32_t longest_corner(std::uint32_t f) const;
  void coarsen(RemeshReport& report);
  void collapse_short(const CollapseLengths& lengths, int rounds, RemeshReport& report);
  std::size_t blunt(int rounds, RemeshReport& report);
  std::size_t collapse_listed(const CollapseLengths& lengths, RemeshReport& report);
  Refusal check_collapse(std::uint32_t u, std::uint32_t v, double longest, std::size_t& at);
  Refusal check_star(std::uint32_t u, std::uint32_t v, double longest, std::size_t& at);
  // Of the collapse of u, whose star is gathered, into star_.ring[at].
  bool keeps_lines(std::uint32_t u, std::size_t at) const;
  bool keeps_lengths(std::uint32_t u, std::size_t at, double longest) const;
  bool keeps_valences(std::size_t at) const;
  static bool stays_flat(const NewFace& face, const Double3& from);
  Refusal check_moved_faces(std::uint32_t u, std::size_t at) const;
  bool keeps_shape(const NewFace& face, const Double3& from) const;
  static bool gets_flat(const NewFace& face);
  bool keeps_sides(std::uint32_t u, std::size_t at) const;
  bool folds_no_more(std::uint32_t u, std::size_t at) const;
  bool keeps_walls(std::uint32_t u, std::size_t at) const;
  bool is_line_near(std::uint32_t u, std::size_t at) const;
  void collapse(std::size_t at);
  bool lines_meet(std::uint32_t u, std::uint32_t v) const;
  bool corners_merge(std::uint32_t u, std::uint32_t v) const;
  void flip_all(RemeshReport& report);
  Refusal try_flip(std::uint32_t c);
  Refusal flip_if_sound(std::uint32_t c);
  int excess(std::uint32_t v, std::uint32_t corner) const;
  bool wants_six(std::uint32_t v) const;
  void glide_all(std::size_t most_steps, RemeshReport& report);
  void glide(std::uint32_t c, bool forward, std::size_t most_steps, RemeshReport& report);
  std::size_t relax_all(RemeshReport& report);
  bool relax(std::uint32_t v, RemeshReport& report);
  bool keeps_chords(std::uint32_t v, const ReferenceSurface::Foot& to) const;
  bool move_vertex(std::uint32_t v, const Double3& to, RemeshReport& report);
  bool move_if_far(std::uint32_t v, const Double3& to, RemeshReport& report);
  Double3 wish(std::uint32_t v) const;
  double share_of_cell(std::uint32_t v, double area) const;
  void measure_cells();
  void add_star_to_cells(std::uint32_t v, const Double3& p, double sign);
  double mean_share() const;
  Double3 wish_for_cells(std::uint32_t v, double mean) const;
  void even_cells(RemeshReport& report);
  void finish(RemeshReport& report);
  std::pair<Double3, Double3> directions_at(std::uint32_t v) const;
  void raise_angles(RemeshReport& report);
  void raise_rounds(RemeshReport& report);
  std::vector<std::uint32_t> sharp_faces() const;
  void raise(std::uint32_t f, bool last_resort, RemeshReport& report);
  bool place_best(std::uint32_t v, RemeshReport& report);
  Double3 best_place(std::uint32_t v) const;
  bool collapse_best(std::uint32_t f, RemeshReport& report);
  bool is_between_lines(std::uint32_t f) const;
  bool is_held(std::uint32_t f) const;
  std::uint32_t corner_to_split(std::uint32_t f) const;
  std::size_t split_sharp(RemeshReport& report);
  void mend_all(RemeshReport& report);
  void mend(std::uint32_t f, RemeshReport& report);
  double sharpness_of(std::uint32_t f) const;
  bool flip_sharp(std::uint32_t f, RemeshReport& report);
  bool flip_cap(std::uint32_t f, RemeshReport& report);
  void recount_after_cap(std::uint32_t v);
  bool shift_sharp(std::uint32_t v, RemeshReport& report);
  template <class IsBetter>
  bool move_if(std::uint32_t v, const Double3& to, RemeshReport& report, const IsBetter& is_better);
  bool move_if_rounder(std::uint32_t v, const Double3& to, double before, RemeshReport& report);
  struct Sharpest;
  struct EvenStep;
  void even_lengths(RemeshReport& report);
  void even_rounds(RemeshReport& report);
  bool even_round(bool splits, bool last, RemeshReport& report);
  bool is_held_uneven(std::uint32_t a, std::uint32_t b) const;
  std::vector<std::array<std::uint32_t, 2>> uneven_edges() const;
  bool is_uneven(std::uint32_t a, std::uint32_t b) const;
  void renew_mean(std::uint32_t v);
  void renew_around(std::uint32_t v);
  std::size_t even_edge(std::uint32_t a, std::uint32_t b, RemeshReport& report);
  Sharpest sharpest_around(const Double3& p) const;
  bool place_even(std::uint32_t v, RemeshReport& report);
  bool flip_or_collapse(std::span<const std::uint32_t> vertices, RemeshReport& report);
  bool flip_even(std::uint32_t c, RemeshReport& report);
  bool collapse_even(std::uint32_t u, std::uint32_t v, RemeshReport& report);
  std::size_t split_uneven(bool last, RemeshReport& report);
  bool split_even(std::uint32_t c, RemeshReport& report);
  void tell_uneven(RemeshReport& report) const;
  bool keeps_near(std::span<const std::uint32_t> faces, std::span<const NewFace> made,
                  RemeshReport& report) const;
  bool keeps_angles(std::span<const std::uint32_t> faces, std::span<const NewFace> made) const;
  std::vector<std::uint32_t> faces_of_star() const;
  std::vector<NewFace> faces_at(std::span<const std::uint32_t> faces) const;
  void hand_points_on(std::span<const std::uint32_t> faces, std::span<const std::uint32_t> made);
  double sharpness_without(std::uint32_t v) const;
  bool collapse_sharp(std::uint32_t f, RemeshReport& report);
  double yielding(double distance) const;
  bool release_weak_creases(std::uint32_t v);
  void count_lines(std::uint32_t v);
  void recount_lines(std::uint32_t v);
  static void leave_line(Info& info);
  double star_sharpness(const Double3& p) const;
  void count_valences();
  void compact();
  void sort_by_position();

  bool normal_fits(const NewFace& f, const Double3& n) const;
  bool within(const NewFace& f, unsigned new_edges) const;
  bool near_at_points(const NewFace& f, unsigned new_edges, double limit, std::uint32_t hint) const;
  double bulge(const NewFace& f, std::uint32_t& hint) const;
  bool beyond(const NewFace& face) const;
  bool near_enough(const Double3& p, double limit, std::uint32_t& hint) const;
  void set_target(Info& info, const Double3& at) const;

  CollapseMesh& mesh_;
  Double3 origin_;
  const ReferenceSurface& surface_;
  const RemeshOptions& options_;
  double min_normal_cosine_ = -1.0;  ///< cosine of max_normal_deviation_deg
  std::vector<Info> info_;
  std::vector<Edge> edges_, listed_;  ///< in the order of work, as found
  std::vector<std::uint8_t> valence_;
  bool mending_ = false, refining_ = false;
  double refine_limit_;               ///< how far mesh and reference may be from each other in the end
  double sharp_above_ = 1.0;          ///< squared cosine of min_angle_deg, with room for rounding
  CoveredPoints* covered_ = nullptr;  ///< while lengths are evened within a tolerance that is proven
  EdgeRatios* ratios_ = nullptr;      ///< while lengths are evened
  double always_sharpness_ = 1.0;     ///< squared cosine of kept_angle_deg, with room
  double kept_sharpness_ = 1.0;       ///< the same of the angle that steps keep now
  std::vector<std::uint8_t> locked_;  ///< per vertex: the tolerance refused a step at an uneven edge there
  bool blunting_ = false;             ///< of edges so short that shapes around them tell nothing
  std::vector<double> cells_;         ///< per vertex: the area of its cell, in the last relaxations
  int round_ = 0;
  std::vector<std::uint8_t> changed_;  ///< per vertex: the round behind the last one that changed its star
  CrossingGuard guard_;
  /// A vertex. A mesh of even faces takes a thousand.
  static constexpr std::uint64_t kMaxLooks = std::uint64_t{1} << 12;
  bool guarded_;
  bool guard_spent_ = false;
  std::uint64_t next_key_ = 0;
  mutable std::uint32_t steps_ = 0;
  std::size_t live_faces_ = 0;
  Star star_;
};

/// Moves the vertex of the gathered star, and back again where that is no better than it was.
template <class IsBetter>
bool Remesher::move_if(std::uint32_t v, const Double3& to, RemeshReport& report, const IsBetter& is_better) {
  const Double3 old = mesh_.at(v);
  const Info kept = info_[v];
  if (!move_vertex(v, to, report)) return false;
  if (is_better()) {
    ++report.moves;
    return true;
  }
  mesh_.node(v).at = old;
  if (guarded_) guard_.accept();
  info_[v] = kept;
  return false;
}

}  // namespace tessera

#include <algorithm>
#include <cmath>
#include <numeric>
#include <string>

#include "kernels/edit/refined_base.h"
#include "kernels/edit/self_intersections.h"
#include "kernels/edit/short_edges.h"
#include "kernels/edit/thin_body.h"
#include "kernels/edit/thin_faces.h"
#include "kernels/edit/upright_low_pass.h"
#include "kernels/remesh/remesh.h"
#include "kernels/smooth/smooth.h"
#include "octree/error.h"
#include "stream/files/json.h"
#include "stream/import/import_stages.h"
#include "stream/runtime/serial_stage.h"
#include "stream/stages/deform/deform_files.h"
#include "stream/stages/deform/deform_needs.h"
#include "stream/stages/deform/deform_stages.h"
#include "stream/stages/deform/edit_roles.h"
#include "stream/stages/deform/edit_script.h"
#include "stream/stages/deform/vertex_batches.h"

namespace tessera {
namespace {

/// Edges between 4/5 and 4/3 of the length make so many more faces than equilateral ones would.
constexpr double kMoreFaces = 1.2;
/// Of the edges: how far operations may leave the surface. The details make up for it.
constexpr double kBaseShare = 0.5;
/// Degrees: less is roughness, and lines along it would leave slivers.
constexpr double kCreaseAngle = 60.0;
/// Bodies thinner than so many edges have a dozen of them around: they come out of remeshing thin and folded, after minutes.
constexpr double kThinBody = 4.0, kMaxThinBody = 0.5;  ///< edges; share of the area
constexpr double kShortest = 0.25;  ///< of the edges: shorter ones that are left are merged

/// Edges across the support of an edit. A mesh with so many stays as it is, but for a share of the area around it.
constexpr double kEnough = 60.0, kMaxCoarse = 0.05;
constexpr double kLeastHeight =
    1e-5;  ///< of a face, times its longest edge: none is split about one without area
/// A coarser one gets so many, and within a few edges of what is held, where regions end between vertices, twice as many twice.
/// Not of order 3: second derivatives beside the support want even faces.
constexpr double kAcross = 40.0, kEvenAcross = 80.0;
constexpr int kEdgeRounds = 2;

class BaseStage : public SerialStage {
 public:
  BaseStage(const JobState& state, const DeformOptions& options, bool own, MeshStore store)
      : options_(options),
        source_{state.inputs.at(0), vertex_window(state.run)},
        own_(own),
        store_(std::move(store)) {}
  std::string name() const override { return "base"; }
  std::uint64_t units() const override { return store_.face_count(); }
  std::string unit_name() const override { return "faces"; }
  std::uint64_t finish_bytes() const override {
    BaseInput input{0, store_.face_count(), store_.block_bytes(all())};
    for (const MeshPatchEntry& e : store_.patches()) input.vertices += e.vertices;
    // What decimation leaves of a large mesh lies in patches of a few dozen faces, most vertices in several of them: of a surface,
    // borders and islands included, as many vertices as faces are there at the most.
    if (!own_) input.vertices = std::min(input.vertices, input.faces);
    return base_stage_bytes(own_, input, options_.base_vertices) + (own_ ? split_base_bytes(options_) : 0);
  }

  Json finish(const std::vector<Json>&, TaskContext& context) const override {
    context.check_stop();
    MeshBlock block = store_.load(all());
    if (block.faces.empty()) throw EmptyError("the mesh has no faces: there is nothing to deform");
    Json out = {{"own", own_}};
    BaseSurface base = own_ ? BaseSurface{std::move(block.position), std::move(block.faces)}
                            : even_base(std::move(block), out, context);
    context.check_stop();
    if (own_ && may_split(options_)) split(base, out, context);
    save_base(context.create(kBaseFile), base);
    out["vertices"] = base.position.size();
    out["faces"] = base.faces.size();
    context.advance(store_.face_count());
    return out;
  }

 private:
  BaseSurface even_base(MeshBlock block, Json& out, TaskContext& context) const {
    double area = 0.0;
    for (const auto& f : block.faces)
      area += 0.5 * norm(triangle_normal(block.position[f[0]], block.position[f[1]], block.position[f[2]]));
    drop_unused(block);
    // Two faces a vertex.
    const double faces = 2.0 * static_cast<double>(options_.base_vertices);
    RemeshOptions remeshing;
    remeshing.edge = std::sqrt(kMoreFaces * 4.0 * area / (std::sqrt(3.0) * faces));
    remeshing.tolerance = kBaseShare * remeshing.edge;
    remeshing.float_positions = false;
    remeshing.feature_angle_deg = kCreaseAngle;
    remeshing.find_creases = true;
    remeshing.max_faces = base_capacity(store_.face_count(), options_.base_vertices);
    remeshing.first_key = std::uint64_t{1} << 63;
    remeshing.pause = [&] { context.check_stop(); };
    out["edge"] = remeshing.edge;
    const bool may_stay = options_.base != "even" && block.position.size() <= options_.base_vertices;
    // Wires and sheets: nothing even comes of them.
    if (may_stay) {
      const double share = thin_body_share(block.position, block.faces, kThinBody * remeshing.edge);
      out["thin_body_area"] = share;
      if (share > kMaxThinBody) {
        out["own"] = true;
        return {std::move(block.position), std::move(block.faces), {}};
      }
    }
    MeshBlock given;  // for who may stay as it is, a small mesh
    if (may_stay) given = block;
    const RemeshReport report = remesh(block, block, remeshing);
    context.check_stop();
    ThinArea thin;
    thin.add(block.position, block.faces);
    out["decimated_faces"] = report.faces_in;
    out["even_thin_area"] = thin.share();
    // What comes out is no better, and may cross itself all over.
    if (thin.share() > kMaxThin && may_stay) {
      out["own"] = true;
      return {std::move(given.position), std::move(given.faces), {}};
    }
    std::vector<Double3> sharp = block.position;
    for (const SmoothRound& round : base_low_pass()) block.position = smooth_block(block, round).position;
    out["unsmoothed_vertices"] = undo_flattening(sharp, block.faces, block.position);
    context.check_stop();
    BaseSurface base{std::move(block.position), std::move(block.faces), std::move(sharp)};
    merge_short_edges(base.position, base.faces, kShortest * remeshing.edge, base.sharp);
    return base;
  }

  /// A base whose edges are long beside the support: regions end anywhere within them, and nothing bends within a face.
  void split(BaseSurface& base, Json& out, TaskContext& context) const {
    const std::size_t before = base.position.size(), most = most_split(options_.base_vertices);
    const EditScript script = parse_edit(options_.edit, "the edit");
    // Unasked, it is told in the report alone.
    const auto leave = [&](const std::string& why) {
      out["whole"] = why;
      if (options_.base != "split") return;
      out["warnings"] = Json::array();
      out["warnings"].push_back("--base split: edges stay as long as they are: " + why);
    };
    if (before >= most)
      return leave("the mesh has " + std::to_string(before) + " vertices, and no base gets more than " +
                   std::to_string(most) + " by splits");
    if (!takes_by_place(script)) return leave("points and vertices that regions name stand for themselves");
    const auto wanted = [&](double across, SupportPart part) {
      return wanted_edges(base.position, base.faces, base_regions(base, script, source_, context).role,
                          1.0 / across, part);
    };
    std::vector<double> edges;
    try {
      edges = wanted(kEnough, SupportPart::kAll);
    } catch (const InputError&) {
      return;  // the stage that solves for it says what is wrong with it
    }
    const double share = coarse_share(base.position, base.faces, edges, 1.0);
    out["coarse_area"] = share;
    if (!(share > kMaxCoarse)) return;
    if (least_height(base.position, base.faces, edges) < kLeastHeight)
      return leave("a face of the support has no area, and its halves would have edges without length");
    base.split_edge = mean_longest_edge(base.position, base.faces, edges);
    base.given_crossings = crossing_support(base, base_regions(base, script, source_, context).role);
    base.given_faces = base.faces;
    double across = script.order == 3 ? kEvenAcross : kAcross;
    for (double& e : edges) e *= kEnough / across;
    const double edge = *std::min_element(edges.begin(), edges.end());
    double longest = split_long_edges(base.position, base.faces, edges, most).longest;
    for (int round = 0; round < kEdgeRounds && script.order < 3; ++round) {
      context.check_stop();
      edges = wanted(across *= 2.0, SupportPart::kEdge);
      longest = std::max(longest, split_long_edges(base.position, base.faces, edges, most).longest);
    }
    out["split"] = {{"vertices_before", before},
                    {"vertices", base.position.size()},
                    {"edge_before", base.split_edge},
                    {"edge", edge},
                    {"longest_edge", longest}};
  }

  /// Faces with a vertex of the support that cross others. Halves of a face lie in one plane: rounding decides there.
  static std::uint64_t crossing_support(const BaseSurface& base, std::span<const std::int32_t> role) {
    std::vector<std::uint8_t> watched;
    for (const auto& f : base.faces)
      watched.push_back(
          std::any_of(f.begin(), f.end(), [&](std::uint32_t v) { return role[v] == kSupportVertex; }));
    return self_intersections(base.position, base.faces, watched).faces.size();
  }

  /// What no base is made of, and room that vectors have beyond their ends.
  static void drop_unused(MeshBlock& block) {
    block.rgba = {};
    block.face_bound = {};
    block.key.shrink_to_fit();
    block.position.shrink_to_fit();
    block.vertex_class.shrink_to_fit();
    block.faces.shrink_to_fit();
    block.face_flags.shrink_to_fit();
  }

  std::vector<std::size_t> all() const {
    std::vector<std::size_t> patches(store_.patches().size());
    std::iota(patches.begin(), patches.end(), std::size_t{0});
    return patches;
  }
  DeformOptions options_;
  RegionSource source_;
  bool own_;
  MeshStore store_;
};

}  // namespace

// What so few vertices hold of short waves is jagged, and folds where a pose presses it together.
const std::vector<SmoothRound>& base_low_pass() {
  static const std::vector<SmoothRound> rounds = [] {
    SmoothOptions o;
    o.lambda = 16.0;
    o.order = 2;
    o.feature_angle_deg = 0.0;
    return smooth_rounds(o);
  }();
  return rounds;
}

std::unique_ptr<Stage> make_base_stage(const JobState& state, const DeformOptions& options,
                                       const std::function<MeshStore(const JobState&)>& reduced) {
  const bool own = is_own_base(state);
  return std::make_unique<BaseStage>(state, options, own,
                                     own ? open_imported_mesh(state.work, kDeformImport) : reduced(state));
}

}  // namespace tessera

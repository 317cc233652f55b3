#include "stream/stages/remesh/sizing_stage.h"

#include <algorithm>
#include <bit>
#include <cmath>

#include "kernels/decimate/collapse_mesh.h"
#include "octree/error.h"
#include "octree/portable_math.h"
#include "stream/files/durable_file.h"
#include "stream/files/json.h"
#include "stream/files/read_file.h"
#include "stream/import/import_stages.h"
#include "stream/runtime/numbers.h"
#include "stream/stages/decimate/simplify_stage.h"

namespace tessera {
namespace {

constexpr std::uint64_t kSizingTaskFaces = 1u << 20;
/// With a tolerance alone: edges are as long as this share of the surface allows; what bends more keeps shorter ones,
/// since operations there are refused.
constexpr double kCalmShare = 0.9;
constexpr double kLongestShare = 0.1;  ///< of the diagonal: no edge gets longer by itself
/// Between 4/5 and 4/3 of the length edges are a little shorter than it in the mean: so many more faces come out.
constexpr double kMoreFaces = 1.125;
/// With a tolerance alone: more faces than so many times those of the input, whose facets they would trace, are refused.
constexpr double kMaxTimes = 1000.0, kAlwaysFaces = 0x1p22;
/// An edge over an arc of this angle is within 0.06 of its length of it. Where so much of the surface bends no more, nearly
/// all edges keep as near, and a few splits do for the others; on the rest of the catalogue's meshes shapes would pay.
constexpr double kFineTurn = 0.5, kFineCalm = 0.99;
constexpr double kAreaUnits = 0x1p40;  ///< the squared diagonal in units of weights

/// Adaptive lengths, if not given: around the one for the calm share. Most of a machined part is flat, which says nothing
/// of its fillets: so the shortest is at most four tolerances, where a chord within 0.42 of them turns by 36 degrees, as a
/// crease does.
constexpr double kShortestOfCalm = 0.25, kLongestOfCalm = 6.0, kShortestOfTolerance = 4.0;

using Curvatures = std::map<std::uint32_t, std::uint64_t>;  ///< weight by class of curvature

std::uint32_t curvature_class(double curvature) {
  return std::bit_cast<std::uint32_t>(static_cast<float>(curvature)) >> 20;
}
double curvature_of_class(std::uint32_t c) {
  return static_cast<double>(std::bit_cast<float>((c + 1) << 20));
}

/// Curvature along edges: by how much the normals at their ends differ. Ends on creases and borders say nothing.
void measure_curvatures(const MeshBlock& block, double feature_angle_deg, double area_unit,
                        Curvatures& curvatures) {
  const CollapseMesh mesh(block, block.position[0]);
  const double minimum = cosine_of_degrees(feature_angle_deg > 0.0 ? feature_angle_deg : 90.0);
  std::vector<Double3> normal(mesh.vertices(), Double3{});
  std::vector<std::uint8_t> silent(mesh.vertices(), 0);
  const auto face_normal = [&](std::size_t f) {
    const std::uint32_t* v = mesh.face(f).vertex;
    return triangle_normal(mesh.at(v[0]), mesh.at(v[1]), mesh.at(v[2]));
  };
  for (std::uint32_t f = 0; f < mesh.faces().size(); ++f) {
    const Double3 n = face_normal(f);
    for (std::uint32_t i = 0; i < 3; ++i) {
      const std::uint32_t c = 4 * f + i, o = mesh.opposite(c);
      normal[mesh.vertex(c)] = normal[mesh.vertex(c)] + n;
      bool quiet = o == kNoCorner;
      if (!quiet) {
        const Double3 m = face_normal(o >> 2);
        quiet = dot(n, m) < minimum * norm(n) * norm(m);
      }
      if (quiet) silent[mesh.vertex(next_corner(c))] = silent[mesh.vertex(prev_corner(c))] = 1;
    }
  }
  for (Double3& n : normal) n = unit_or_zero(n);
  for (std::uint32_t f = 0; f < mesh.faces().size(); ++f) {
    const double area = norm(face_normal(f)) / 6.0;
    for (std::uint32_t c = 4 * f; c < 4 * f + 3; ++c) {
      const std::uint32_t a = mesh.vertex(next_corner(c)), b = mesh.vertex(prev_corner(c));
      const double length = norm(mesh.at(b) - mesh.at(a));
      if (silent[a] || silent[b] || !(length > 0.0)) continue;
      curvatures[curvature_class(norm(normal[b] - normal[a]) / length)] +=
          static_cast<std::uint64_t>(area / area_unit) + 1;
    }
  }
}

class SizingStage : public Stage {
 public:
  SizingStage(const JobState& state, const RemeshJobOptions& options)
      : store_(open_imported_mesh(state.work, "mesh")), options_(options) {
    if (options_.tolerance > 0.0 && !(options_.tolerance < store_.diagonal()))
      throw UsageError("--tolerance " + number_text(options_.tolerance) +
                       " is more than the whole mesh, which is " + number_text(store_.diagonal()) +
                       " wide: give less");
    first_ = tasks_by_faces(store_.patches(), kSizingTaskFaces);
  }
  std::string name() const override { return "sizing"; }
  std::size_t task_count() const override { return first_.size() - 1; }
  std::uint64_t units() const override { return store_.face_count(); }
  std::string unit_name() const override { return "faces"; }
  std::uint64_t task_bytes(std::size_t) const override {
    return 3 * store_.largest_patch_bytes() + (std::uint64_t{1} << 20);
  }
  std::uint64_t finish_bytes() const override {
    return store_.patches().size() * 600 + (std::uint64_t{4} << 20);
  }

  Json run(std::size_t task, TaskContext& context) const override {
    Json areas = Json::array();
    Curvatures all;
    const double unit = store_.diagonal() * store_.diagonal() / kAreaUnits;
    for (std::size_t p = first_[task]; p < first_[task + 1]; ++p) {
      context.check_stop();
      const MeshBlock block = store_.load({&p, 1});
      double area = 0.0;
      for (const auto& f : block.faces)
        area += 0.5 * norm(triangle_normal(block.position[f[0]], block.position[f[1]], block.position[f[2]]));
      areas.push_back(area);
      if (by_curvature() || options_.may_be_fine())
        measure_curvatures(block, options_.feature_angle_deg, unit, all);
      context.advance(block.faces.size());
    }
    Json curvatures = Json::array();
    for (const auto& [c, weight] : all) curvatures.push_back({c, weight});
    return {{"areas", areas}, {"bends", curvatures}};
  }

  Json finish(const std::vector<Json>& tasks, TaskContext& context) const override {
    std::vector<double> areas;
    Curvatures curvatures;
    for (const Json& task : tasks) {
      for (const Json& area : task.at("areas")) areas.push_back(area.get<double>());
      for (const Json& curvature : task.at("bends"))
        curvatures[curvature[0].get<std::uint32_t>()] += curvature[1].get<std::uint64_t>();
    }
    double area = 0.0;
    for (const double a : areas) area += a;
    if (!(area > 0.0)) throw EmptyError("the mesh has no area: there is nothing to remesh");
    const double calm = edge_for(area, curvatures);
    double edge = calm, shortest = 0.0;
    if (options_.adaptive) {
      const double maximum = kLongestShare * store_.diagonal();
      edge = options_.max_edge > 0.0 ? options_.max_edge : std::fmin(kLongestOfCalm * calm, maximum);
      const double minimum = std::fmin(kShortestOfCalm * calm, kShortestOfTolerance * options_.tolerance);
      shortest = options_.min_edge > 0.0 ? options_.min_edge : std::fmin(minimum, edge);
      if (shortest > edge)
        throw UsageError("--min-edge " + number_text(shortest) +
                         " is more than edges would get by themselves, " + number_text(edge) +
                         ": give --max-edge too");
    }
    if (by_curvature()) refuse_countless(area, std::fmax(calm, options_.min_edge));
    // What adapts is guessed by the calm share's length; blocks have room for more.
    const double face = std::sqrt(3.0) / 4.0 * calm * calm;
    Sizing sizing;
    sizing.edge = edge, sizing.shortest = shortest;
    sizing.fine = options_.may_be_fine() && calm_share(curvatures, kFineTurn / edge) >= kFineCalm;
    double sum = 0.0;
    for (std::size_t p = 0; p < areas.size(); ++p) {
      const double faces = std::ceil(areas[p] / face);
      sum += faces;
      if (!(sum < 0x1p40))
        throw UsageError("edges of " + number_text(edge) +
                         " would make more faces than can be counted: " + "give longer ones");
      sizing.faces.emplace(store_.patches()[p].key, static_cast<std::uint64_t>(faces));
    }
    write_text(context.create(sizing_file(0)), dump_json(sizing.to_json()));
    Json result = {{"edge", edge},
                   {"shortest_edge", shortest},
                   {"area", area},
                   {"expected_faces", area / face},
                   {"follows_closely", sizing.fine}};
    if (edge > 0.5 * store_.diagonal())
      result["warnings"] = {"edges of " + number_text(edge) + " are longer than half of the mesh, which is " +
                            number_text(store_.diagonal()) + " wide: hardly a face can be so large"};
    return result;
  }

 private:
  bool by_curvature() const { return !(options_.edge > 0.0) && options_.faces == 0; }

  /// The number of faces goes with one over the tolerance, as the square of a chord goes with its height.
  /// \throws ValidationError  naming the least tolerance, rounded up
  void refuse_countless(double area, double edge) const {
    const double faces = area / (std::sqrt(3.0) / 4.0 * edge * edge);
    const double maximum = std::fmax(kAlwaysFaces, kMaxTimes * static_cast<double>(store_.face_count()));
    if (!(faces > maximum)) return;
    throw ValidationError("within " + number_text(options_.tolerance) + " of this mesh of " +
                          std::to_string(store_.face_count()) + " faces edges of " + number_text(edge) +
                          " would make " + number_text(faces) +
                          " faces: the least --tolerance that can do is " +
                          number_text(round_up_2_digits(options_.tolerance * faces / maximum)) +
                          (options_.adaptive ? ", or give --min-edge" : ", or give --edge or --faces too"));
  }

  /// What share of the surface bends no more than that.
  static double calm_share(const Curvatures& curvatures, double curvature) {
    double all = 0.0, calm = 0.0;
    for (const auto& [c, weight] : curvatures) {
      all += static_cast<double>(weight);
      if (curvature_of_class(c) <= curvature) calm += static_cast<double>(weight);
    }
    return all > 0.0 ? calm / all : 1.0;
  }

  double edge_for(double area, const Curvatures& curvatures) const {
    if (options_.edge > 0.0) return options_.edge;
    if (options_.faces > 0)
      return std::sqrt(kMoreFaces * 4.0 * area / (std::sqrt(3.0) * static_cast<double>(options_.faces)));
    std::uint64_t all = 0, calm = 0;
    for (const auto& [c, weight] : curvatures) all += weight;
    double edge = kLongestShare * store_.diagonal();
    for (const auto& [c, weight] : curvatures) {
      calm += weight;
      if (static_cast<double>(calm) < kCalmShare * static_cast<double>(all)) continue;
      // Dunyach et al. 2013: a chord of this length is within E of a circle of that curvature.
      const double e = options_.tolerance, square = 6.0 * e / curvature_of_class(c) - 3.0 * e * e;
      edge = std::fmin(edge, std::sqrt(std::fmax(square, e * e)));
      break;
    }
    return edge;
  }

  MeshStore store_;
  RemeshJobOptions options_;
  std::vector<std::size_t> first_;
};

}  // namespace

std::uint64_t Sizing::expected(const MeshPatchEntry& patch) const {
  const auto at = faces.find(patch.key);
  return at == faces.end() ? patch.faces : at->second;
}

Sizing Sizing::longer(double times, std::uint64_t found) const {
  Sizing out = *this;
  out.edge *= times, out.shortest *= times;
  out.left = found;
  out.fine = false;
  for (auto& [key, expected] : out.faces)
    expected = static_cast<std::uint64_t>(std::ceil(static_cast<double>(expected) / (times * times)));
  return out;
}

Sizing Sizing::coarser() const {
  Sizing out = *this;
  out.fine = false;
  return out;
}

Json Sizing::to_json() const {
  Json expected = Json::array();
  for (const auto& [key, count] : faces) expected.push_back({key, count});
  return {{"edge", edge}, {"shortest", shortest}, {"fine", fine}, {"left", left}, {"faces", expected}};
}

Sizing Sizing::of_work(const std::filesystem::path& work, int round) {
  const Json j = parse_json(read_text(work / sizing_file(first_round_of_size(work, round))));
  Sizing sizing;
  j.at("edge").get_to(sizing.edge);
  j.at("shortest").get_to(sizing.shortest);
  j.at("fine").get_to(sizing.fine);
  sizing.left = j.value("left", std::uint64_t{0});
  for (const Json& brick : j.at("faces"))
    sizing.faces.emplace(brick[0].get<std::uint64_t>(), brick[1].get<std::uint64_t>());
  return sizing;
}

std::string sizing_file(int round) {
  return round == 0 ? "sizing.json" : "again-" + std::to_string(round) + "-sizing.json";
}

bool was_too_fine(const std::filesystem::path& work, int round) {
  return std::filesystem::exists(work / sizing_file(round + 1));
}

int first_round_of_size(const std::filesystem::path& work, int round) {
  while (round > 0 && !was_too_fine(work, round - 1)) --round;
  return round;
}

int last_remesh_round(const std::filesystem::path& work) {
  int round = 0;
  while (round + 1 < kMaxRounds &&
         (was_too_fine(work, round) || std::filesystem::exists(work / failed_faces_file(round))))
    ++round;
  return round;
}

std::unique_ptr<Stage> make_sizing_stage(const JobState& state, const RemeshJobOptions& options) {
  return std::make_unique<SizingStage>(state, options);
}

}  // namespace tessera

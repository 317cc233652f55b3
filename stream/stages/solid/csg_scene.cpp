/// What people write of a scene becomes a postfix list.
#include <algorithm>
#include <cmath>
#include <fstream>

#include "kernels/solid/swept_tool.h"
#include "octree/error.h"
#include "stream/files/durable_file.h"
#include "stream/files/json.h"
#include "stream/points/reconstruct_options.h"
#include "stream/stages/solid/csg_job.h"

namespace tessera {
namespace {

constexpr int kMaxDeep = 1000;  ///< what a scene nests: it is read by functions that call themselves

Json numbers_of_placement(const Placement& p) {
  Json out = Json::array();
  for (const double m : p.matrix) out.push_back(m);
  for (const double s : p.shift) out.push_back(s);
  return out;
}

void push_mesh(CsgScene& scene, Json& program, const std::filesystem::path& file,
               const Placement& placement) {
  program.push_back({{"mesh", scene.meshes.size()}, {"placement", numbers_of_placement(placement)}});
  scene.meshes.push_back(file);
}

std::string join_of_word(const std::string& word) {
  return word == "+"                  ? "union"
         : word == "-"                ? "difference"
         : word == "*" || word == "&" ? "intersection"
                                      : "";
}

/// Words from left to right: solid { join solid }, a solid being a file or a group in parentheses.
class Words {
 public:
  explicit Words(const std::vector<std::string>& words) : words_(words) {}
  CsgScene parse() {
    sum();
    if (at_ < words_.size()) fail("is not expected here");
    scene_.program = dump_json(program_);
    return std::move(scene_);
  }

 private:
  [[noreturn]] void fail(const std::string& what) const {
    if (at_ >= words_.size()) throw UsageError("the expression ends too early: a file or ')' is missing");
    throw UsageError("'" + words_[at_] + "' " + what +
                     ": an expression is files with + - * or & between them, e.g. "
                     "a.ply + b.stl - c.obj");
  }
  void sum() {
    solid();
    while (at_ < words_.size() && words_[at_] != ")") {
      const std::string join = join_of_word(words_[at_]);
      if (join.empty()) fail("follows a solid");
      ++at_;
      solid();
      program_.push_back({{"join", join}});
    }
  }
  void solid() {
    if (at_ >= words_.size()) fail("");
    if (words_[at_] == "(") {
      ++at_;
      sum();
      if (at_ >= words_.size()) fail("");
      ++at_;
      return;
    }
    if (words_[at_] == ")" || !join_of_word(words_[at_]).empty()) fail("stands where a solid should");
    push_mesh(scene_, program_, words_[at_++], {});
  }

  const std::vector<std::string>& words_;
  std::size_t at_ = 0;
  CsgScene scene_;
  Json program_ = Json::array();
};

class SceneFile {
 public:
  CsgScene read(const std::filesystem::path& file) {
    node_of_file(file, {});
    if (program_.empty()) throw InputError(file.string() + ": the scene is empty");
    scene_.program = dump_json(program_);
    return std::move(scene_);
  }

 private:
  /// What went wrong, in the file at hand.
  [[noreturn]] void fail(const std::string& what) const {
    throw InputError(open_.back().string() + ": " + what);
  }

  void node_of_file(const std::filesystem::path& file, const Placement& outer) {
    std::error_code none;
    const std::filesystem::path real = std::filesystem::weakly_canonical(file, none);
    if (std::find(open_.begin(), open_.end(), real) != open_.end())
      throw InputError(file.string() + ": the scene holds itself");
    open_.push_back(real);
    node(parse_json(read_text(file), file.string()), outer);
    open_.pop_back();
  }

  std::vector<double> numbers(const Json& value, std::size_t count, const std::string& what) const {
    if (!value.is_array() || value.size() != count)
      fail(what + " takes " + std::to_string(count) + " numbers");
    std::vector<double> out;
    for (const Json& v : value) {
      if (!v.is_number()) fail(what + " takes numbers");
      out.push_back(v.get<double>());
    }
    return out;
  }

  /// "scale", "rotate" [axis, degrees], "translate", done in this order; or "matrix" (rows of 3 x 4).
  Placement placement(const Json& n) const {
    Placement p;
    if (n.contains("matrix")) {
      const std::vector<double> m = numbers(n.at("matrix"), 12, "\"matrix\"");
      for (std::size_t r = 0; r < 3; ++r) {
        for (std::size_t c = 0; c < 3; ++c) p.matrix[3 * r + c] = m[4 * r + c];
        p.shift[r] = m[4 * r + 3];
      }
    }
    if (n.contains("scale")) {
      const Json& s = n.at("scale");
      const std::vector<double> v =
          s.is_number() ? std::vector<double>(3, s.get<double>()) : numbers(s, 3, "\"scale\"");
      p = Placement{{v[0], 0, 0, 0, v[1], 0, 0, 0, v[2]}, {0, 0, 0}}.after(p);
    }
    if (n.contains("rotate")) {
      const std::vector<double> r = numbers(n.at("rotate"), 4, "\"rotate\"");
      const Double3 axis = unit_or_zero(Double3{r[0], r[1], r[2]});
      if (axis == Double3{0, 0, 0}) fail("\"rotate\": the axis has no direction");
      p = rotation(axis, r[3]).after(p);
    }
    if (n.contains("translate")) {
      const std::vector<double> t = numbers(n.at("translate"), 3, "\"translate\"");
      p.shift = p.shift + Double3{t[0], t[1], t[2]};
    }
    if (!(std::fabs(p.determinant()) > 0.0)) fail("a placement is flat: it scales to nothing");
    return p;
  }

  void node(const Json& n, const Placement& outer) {
    const Deeper level(depth_);
    if (depth_ > kMaxDeep) fail("solids stand in each other more than " + std::to_string(kMaxDeep) + " deep");
    if (!n.is_object()) fail("a solid is an object, e.g. {\"mesh\": \"a.ply\"}");
    if (n.contains("scan")) {
      scan(n, outer.after(placement(n)));
      return;
    }
    std::vector<std::string> kinds;
    for (const auto& [key, value] : n.items())
      if (key != "translate" && key != "rotate" && key != "scale" && key != "matrix" && key != "blend")
        kinds.push_back(key);
    if (kinds.size() > 1)
      fail("\"" + kinds[0] + "\" and \"" + kinds[1] + "\" stand in one object: a solid is one of them");
    if (kinds.empty()) fail("the scene is empty");
    const std::string& kind = kinds[0];
    const Placement here = outer.after(placement(n));
    const Json& value = n.at(kind);
    const bool is_join = kind == "union" || kind == "intersection" || kind == "difference";
    if (n.contains("blend") && !is_join) fail("\"blend\" stands beside union, intersection or difference");
    if (is_join) {
      if (!value.is_array() || value.empty()) fail("\"" + kind + "\" takes a list of at least one solid");
      if (n.contains("blend")) {
        blend(n, kind, here);
        return;
      }
      for (std::size_t i = 0; i < value.size(); ++i) {
        node(value[i], here);
        if (i > 0) program_.push_back({{"join", kind}});
      }
    } else if (kind == "mesh" || kind == "scene") {
      if (!value.is_string()) fail("\"" + kind + "\" takes the name of a file");
      const std::filesystem::path file = open_.back().parent_path() / value.get<std::string>();
      if (kind == "mesh") {
        push_mesh(scene_, program_, file, here);
      } else {
        node_of_file(file, here);
      }
    } else if (kind == "mill") {
      mill(value, here);
    } else {
      const std::size_t count = shape_numbers(kind);
      if (count == 0) {
        std::string known;
        for (const std::string_view k : kShapeKinds) known.append(", ").append(k);
        fail("\"" + kind +
             "\" is no solid: there are mesh, scan, scene, union, intersection, difference, mill" + known);
      }
      const std::vector<double> v = numbers(value, count, "\"" + kind + "\"");
      if (const std::string fault = shape_fault(kind, v); !fault.empty()) fail("\"" + kind + "\": " + fault);
      program_.push_back({{"shape", kind}, {"numbers", v}, {"placement", numbers_of_placement(here)}});
    }
  }

  /// {"scan": file or list of files}, and options of `reconstruct` beside it.
  void scan(const Json& n, const Placement& here) {
    CsgScan made;
    const Json& value = n.at("scan");
    const Json files = value.is_string() ? Json::array({value}) : value;
    if (!files.is_array() || files.empty()) fail("\"scan\" takes the name of a file, or a list of them");
    for (const Json& file : files) {
      if (!file.is_string()) fail("\"scan\" takes the name of a file, or a list of them");
      made.files.push_back(open_.back().parent_path() / file.get<std::string>());
    }
    Json requested = {{"holes", "close"}};
    for (const auto& [key, v] : n.items())
      if (key != "scan" && key != "translate" && key != "rotate" && key != "scale" && key != "matrix")
        requested[key] = v;
    try {
      ReconstructOptions options;
      option_table(options).from_json(requested);
      made.options = to_settings(options);
    } catch (const UsageError& wrong) {
      fail(std::string("\"scan\": ") + wrong.what());
    }
    auto at = std::find(scene_.scans.begin(), scene_.scans.end(), made);
    if (at == scene_.scans.end()) at = scene_.scans.insert(at, std::move(made));
    scene_.scan_of[scene_.meshes.size()] = static_cast<std::size_t>(at - scene_.scans.begin());
    push_mesh(scene_, program_, {}, here);
  }

  /// What a rounded joint joins becomes one implicit solid, one step of the program. Two plain solids alone: where
  /// rounds meet, a ball touches three surfaces, and BlendedShape finds those of two.
  void blend(const Json& n, const std::string& kind, const Placement& here) {
    if (!n.at("blend").is_number() || !(n.at("blend").get<double>() > 0.0) ||
        !std::isfinite(n.at("blend").get<double>()))
      fail("\"blend\" takes a radius above 0");
    if (!is_similarity(here))
      fail("\"blend\": what is rounded may be turned, moved and scaled alike, not stretched");
    const double radius = n.at("blend").get<double>() * here_scale(here);
    Json outer = std::move(program_);
    program_ = Json::array();
    for (const Json& solid : n.at(kind)) {
      node(solid, here);
      for (const Json& step : program_) rounds(step);
    }
    const auto is_shape = [](const Json& step) { return step.contains("shape"); };
    if (n.at(kind).size() != 2 || program_.size() != 2 || !std::ranges::all_of(program_, is_shape))
      fail("\"blend\" rounds the joint of two solids, each of one shape: put what is made of more beside it");
    Json both = std::move(program_);
    program_ = std::move(outer);
    program_.push_back({{"blend", std::move(both)}, {"join", kind}, {"radius", radius}});
  }
  static double here_scale(const Placement& p) {
    return norm(Double3{p.matrix[0], p.matrix[3], p.matrix[6]});
  }
  /// Whether a step's values are distances.
  void rounds(const Json& step) const {
    if (step.contains("mesh") || step.contains("mill"))
      fail("\"blend\" rounds joints of implicit solids alone: no mesh, scan or mill may stand in it");
    if (!step.contains("shape")) return;
    Placement p;
    for (std::size_t k = 0; k < 9; ++k) p.matrix[k] = step.at("placement").at(k).get<double>();
    if (!is_similarity(p))
      fail("\"blend\": what is rounded may be turned, moved and scaled alike, not stretched");
  }

  /// {"ball": r}, {"flat": r} or {"bull": [r, rim]}, "length", "path".
  void mill(const Json& value, const Placement& here) {
    const std::string what =
        "\"mill\" takes an object with \"ball\": radius, \"flat\": radius or \"bull\": [radius, "
        "rim], with \"length\" and \"path\"";
    if (!value.is_object()) fail(what);
    std::vector<double> tool;
    for (const auto& [key, v] : value.items()) {
      if (key == "length" || key == "path") continue;
      if (!tool.empty() || (key != "ball" && key != "flat" && key != "bull")) fail(what);
      if (key == "bull") {
        tool = numbers(v, 2, "\"bull\"");
      } else {
        if (!v.is_number()) fail(what);
        tool = {v.get<double>(), key == "ball" ? v.get<double>() : 0.0};
      }
    }
    if (tool.empty() || !value.contains("length") || !value.at("length").is_number() ||
        !value.contains("path") || !value.at("path").is_string())
      fail(what);
    tool.push_back(value.at("length").get<double>());
    if (!(tool[0] > 0.0) || !(tool[1] >= 0.0) || !(tool[1] <= tool[0]) || !(tool[2] > tool[1]) ||
        !std::isfinite(tool[0] + tool[2]))
      fail(
          "\"mill\": the radius must be above 0, the rim no larger, and the tool longer than its rim is "
          "high");
    if (!is_similarity(here)) fail("\"mill\": a tool may be turned, moved and scaled alike, not stretched");
    program_.push_back(
        {{"mill", scene_.paths.size()}, {"numbers", tool}, {"placement", numbers_of_placement(here)}});
    scene_.paths.push_back(open_.back().parent_path() / value.at("path").get<std::string>());
  }

  struct Deeper {
    explicit Deeper(int& depth) : depth_(depth) { ++depth_; }
    ~Deeper() { --depth_; }
    int& depth_;
  };

  CsgScene scene_;
  Json program_ = Json::array();
  std::vector<std::filesystem::path> open_;  ///< files at work, the innermost last
  int depth_ = 0;
};

}  // namespace

CsgScene parse_csg_words(const std::vector<std::string>& words) {
  return Words(words).parse();
}

CsgScene read_csg_scene(const std::filesystem::path& file) {
  return SceneFile().read(file);
}

}  // namespace tessera

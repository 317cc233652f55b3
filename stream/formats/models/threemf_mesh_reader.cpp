/// 3MF (3MF Core Specification 1.3; Production Extension 1.1 for objects in other parts): all meshes of what is built, placed by their
/// transforms, one behind the other. An archive is read once to know its objects and what is built of them, and then streamed as often
/// as the object that is built most often is. Coordinates are taken as they are, in the unit of the file.
#include <array>
#include <charconv>
#include <map>
#include <optional>
#include <set>

#include "stream/formats/colour_range.h"
#include "stream/formats/meshes/mesh_reader_base.h"
#include "stream/formats/models/zip_archive.h"
#include "stream/formats/scalar.h"
#include "stream/formats/xml_events.h"

namespace tessera {
namespace {

constexpr std::size_t kMostObjects = std::size_t{1} << 20, kMostInstances = std::size_t{1} << 16;
constexpr int kDeepestComponents = 32;

/// Rows of the matrix that a row vector is multiplied with, as 3MF has it.
struct ModelTransform {
  std::array<double, 12> m = {1, 0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0};
  bool identity = true;

  Double3 operator()(const Double3& p) const {
    if (identity) return p;
    Double3 q;
    for (std::size_t k = 0; k < 3; ++k) q[k] = p[0] * m[k] + p[1] * m[3 + k] + p[2] * m[6 + k] + m[9 + k];
    return q;
  }
  /// First this one, then `outer`.
  ModelTransform then(const ModelTransform& outer) const {
    if (outer.identity) return *this;
    if (identity) return outer;
    ModelTransform all;
    all.identity = false;
    for (std::size_t row = 0; row < 4; ++row)
      for (std::size_t k = 0; k < 3; ++k) {
        double sum = row == 3 ? outer.m[9 + k] : 0.0;
        for (std::size_t j = 0; j < 3; ++j) sum += m[3 * row + j] * outer.m[3 * j + k];
        all.m[3 * row + k] = sum;
      }
    return all;
  }
  bool mirrors() const {
    return m[0] * (m[4] * m[8] - m[5] * m[7]) - m[1] * (m[3] * m[8] - m[5] * m[6]) +
               m[2] * (m[3] * m[7] - m[4] * m[6]) <
           0.0;
  }
};

/// An object by its part and its number there.
using ObjectName = std::pair<std::string, std::uint64_t>;
struct ModelUse {
  ObjectName object;
  ModelTransform transform;
};
struct ModelObject {
  ObjectName name;
  std::uint64_t vertices = 0, triangles = 0;
  std::vector<ModelUse> components;
  std::vector<ModelTransform> instances;
  std::vector<std::uint64_t> first_vertex;  ///< of every instance
};

/// What is asked of a model part while it streams by; all may be empty.
struct ModelEvents {
  std::function<void(const ObjectName&)> object;
  std::function<void(const Double3&)> vertex;
  std::function<void(const std::array<std::uint64_t, 3>&)> triangle;
  std::function<void(const ModelUse&)> component, item;
  std::function<void(std::string_view, const std::string&)> metadata;
  std::function<void(const std::string&)> unit;
  bool floats = false;  ///< decimals stand for floats
};

class ModelPart : public XmlEvents {
 public:
  ModelPart(std::string where, std::string part, const ModelEvents& events)
      : XmlEvents(std::move(where)), part_(std::move(part)), events_(events) {}
  bool coloured() const { return coloured_; }

 private:
  void start(std::string_view full, Attributes a) override {
    if (depth_++ == 0) {
      if (local(full) != "model") fail("no 3MF model begins here");
      prefix_ = full.substr(0, full.size() - local(full).size());
      const char* const unit = attribute(a, "unit");
      if (events_.unit) events_.unit(unit != nullptr ? unit : "millimeter");
      return;
    }
    if (!full.starts_with(prefix_)) return;
    const std::string_view name = full.substr(prefix_.size());
    if (name == "vertex" && in_mesh_) {
      if (events_.vertex) events_.vertex({number(a, "x"), number(a, "y"), number(a, "z")});
    } else if (name == "triangle" && in_mesh_) {
      if (attribute(a, "pid") != nullptr || attribute(a, "p1") != nullptr) coloured_ = true;
      if (events_.triangle) events_.triangle({index(a, "v1"), index(a, "v2"), index(a, "v3")});
    } else if (name == "mesh") {
      in_mesh_ = true;
    } else if (name == "object") {
      if (attribute(a, "pid") != nullptr) coloured_ = true;
      if (events_.object) events_.object({part_, index(a, "id")});
    } else if (name == "component") {
      if (events_.component) events_.component(use(a));
    } else if (name == "item") {
      if (events_.item) events_.item(use(a));
    } else if (name == "metadata") {
      const char* const what = attribute(a, "name");
      metadata_ = what != nullptr ? what : "";
      text_.clear();
    }
  }
  void end(std::string_view full) override {
    --depth_;
    if (!full.starts_with(prefix_)) return;
    const std::string_view name = full.substr(prefix_.size());
    if (name == "mesh") in_mesh_ = false;
    if (name == "metadata" && events_.metadata) events_.metadata(metadata_, text_);
    if (name == "metadata") metadata_.clear();
  }
  void text(std::string_view bytes) override {
    constexpr std::size_t kLongestText = 4096;
    if (!metadata_.empty())
      text_.append(bytes.substr(0, kLongestText - std::min(kLongestText, text_.size())));
  }

  double number(Attributes a, const char* name) const {
    const char* const value = attribute(a, name);
    std::string_view rest = value != nullptr ? value : "";
    double x = 0.0;
    if (!take_number(rest, x) || !rest.empty()) fail(std::string("a vertex without a number as its ") + name);
    return events_.floats ? double{static_cast<float>(x)} : x;
  }
  std::uint64_t index(Attributes a, const char* name) const {
    const char* const value = attribute(a, name);
    const std::string_view word = value != nullptr ? value : "";
    std::uint64_t x = 0;
    const auto [end, error] = std::from_chars(word.data(), word.data() + word.size(), x);
    if (error != std::errc() || end != word.data() + word.size() || word.empty())
      fail(std::string("an element without a whole number as its ") + name);
    return x;
  }
  ModelUse use(Attributes a) const {
    ModelUse u;
    const char* const path = attribute(a, "path");
    u.object = {path != nullptr ? path : part_, index(a, "objectid")};
    const char* const text = attribute(a, "transform");
    if (text == nullptr) return u;
    std::string_view rest = text;
    u.transform.identity = false;
    for (double& value : u.transform.m) {
      rest.remove_prefix(std::min(rest.find_first_not_of(" \t\r\n"), rest.size()));
      if (!take_number(rest, value)) fail("a transform that is not twelve numbers");
    }
    return u;
  }

  const std::string part_;
  const ModelEvents& events_;
  std::string prefix_, metadata_, text_;
  int depth_ = 0;
  bool in_mesh_ = false, coloured_ = false;
};

/// The part that the archive's relationships call its model.
class ModelRelation : public XmlEvents {
 public:
  using XmlEvents::XmlEvents;
  std::string target;

 private:
  void start(std::string_view name, Attributes a) override {
    const char *const type = attribute(a, "Type"), *const where = attribute(a, "Target");
    if (local(name) != "Relationship" || type == nullptr || where == nullptr || !target.empty()) return;
    if (std::string_view(type).ends_with("/3dmodel")) target = where;
  }
  void end(std::string_view) override {}
};

class ThreemfMeshReader : public MeshReader {
 public:
  ThreemfMeshReader(ReadFile file, const MeshReadOptions& options)
      : file_(std::move(file)), options_(options), archive_(file_) {
    const ZipArchive::Entry* const relations = archive_.find("_rels/.rels");
    if (relations == nullptr)
      throw InputError(file_.path().string() + ": a ZIP archive, but no 3MF: it has no _rels/.rels");
    ModelRelation relation(where(relations->name));
    parse(*relations, relation);
    if (relation.target.empty())
      throw InputError(file_.path().string() + ": a ZIP archive, but no 3MF: its _rels/.rels names no model");
    find_objects(relation.target);
    place_objects();
  }

  const MeshHeader& header() const override { return header_; }
  const std::string& format() const override { return format_; }

  void read_vertices(const VertexSink& sink) override {
    VertexBatch batch(sink, false);
    const ModelTransform* placed = nullptr;
    each_instance(
        [&](const ModelObject& o, std::size_t i) { placed = &o.instances[i]; },
        [&](ModelEvents& events) {
          events.vertex = [&](const Double3& p) {
            if (placed == nullptr) return;
            const Double3 q = (*placed)(p);
            batch.add(has_origin_ ? Double3{origin_[0] + q[0], origin_[1] + q[1], origin_[2] + q[2]} : q);
          };
        },
        [&] { placed = nullptr; });
    batch.flush();
  }

  void read_faces(const FaceSink& sink) override {
    FaceBatch batch(sink, options_, vertices_, [&] { return file_.path().string() + ": object " + at_; });
    const ModelObject* object = nullptr;
    std::uint64_t first = 0;
    bool mirrored = false;
    each_instance(
        [&](const ModelObject& o, std::size_t i) {
          object = &o, first = o.first_vertex[i], mirrored = o.instances[i].mirrors();
          at_ = std::to_string(o.name.second);
        },
        [&](ModelEvents& events) {
          events.triangle = [&](const std::array<std::uint64_t, 3>& v) {
            if (object == nullptr) return;
            std::array<std::uint64_t, 3> f;
            for (std::size_t k = 0; k < 3; ++k)  // beyond its own object is beyond all
              f[k] = v[k] < object->vertices ? first + v[k]
                                             : vertices_ + std::min<std::uint64_t>(v[k], 0xffffffffu);
            mirrored ? batch.triangle(f[0], f[2], f[1]) : batch.triangle(f[0], f[1], f[2]);
          };
        },
        [&] { object = nullptr; });
    batch.flush();
  }

  std::vector<std::string> warnings() const override { return warnings_; }

 private:
  std::string where(const std::string& part) const {
    return file_.path().string() + ": entry '" + part.substr(0, 80) + "'";
  }
  void parse(const ZipArchive::Entry& entry, XmlEvents& xml) const {
    archive_.read(entry, [&](std::string_view bytes) { return xml.feed(bytes); });
    xml.finish();
  }
  const ZipArchive::Entry& part(const std::string& name) const {
    const ZipArchive::Entry* const entry = archive_.find(name);
    if (entry == nullptr)
      throw InputError(file_.path().string() + ": the part '" + name.substr(0, 80) +
                       "' that the 3MF names is not in its archive");
    return *entry;
  }
  static std::string part_name(const std::string& name) {
    return name.starts_with('/') ? name.substr(1) : name;
  }

  /// Of the root part, and of those that its components lie in.
  void find_objects(const std::string& root) {
    std::set<std::string> seen;
    bool coloured = false;
    parts_ = {part_name(root)};
    for (std::size_t k = 0; k < parts_.size(); ++k) {
      const std::string name = parts_[k];
      if (!seen.insert(name).second) continue;
      ModelEvents events;
      const auto ask_for = [&](ModelUse use) {
        use.object.first = part_name(use.object.first);
        if (std::find(parts_.begin(), parts_.end(), use.object.first) == parts_.end()) {
          if (parts_.size() > kMostObjects / 64)
            throw InputError(where(name) + ": more parts than Tessera reads");
          parts_.push_back(use.object.first);
        }
        return use;
      };
      events.object = [&](const ObjectName& object) {
        if (objects_.size() >= kMostObjects)
          throw InputError(where(name) + ": more objects than Tessera reads");
        if (!index_.emplace(object, objects_.size()).second)
          throw InputError(where(name) + ": two objects of the number " + std::to_string(object.second));
        objects_.push_back({object, 0, 0, {}, {}, {}});
      };
      events.vertex = [&](const Double3&) {
        if (!objects_.empty()) ++objects_.back().vertices;
      };
      events.triangle = [&](const auto&) {
        if (!objects_.empty()) ++objects_.back().triangles;
      };
      events.component = [&](const ModelUse& use) {
        if (objects_.empty()) return;
        if (++components_ > kMostObjects)
          throw InputError(where(name) + ": more components than Tessera reads");
        objects_.back().components.push_back(ask_for(use));
      };
      if (k == 0) {
        events.item = [&](const ModelUse& use) {
          if (items_.size() >= kMostInstances)
            throw InputError(where(name) + ": more items than Tessera reads");
          items_.push_back(ask_for(use));
        };
        events.metadata = [&](std::string_view what, const std::string& text) { take(what, text); };
        events.unit = [&](const std::string& unit) { take_unit(unit); };
      }
      ModelPart model(where(name), name, events);
      parse(part(name), model);
      coloured = coloured || model.coloured();
    }
    if (coloured) warnings_ = list_left_out({"colours and materials"});
  }

  /// What our own writer tells.
  void take(std::string_view what, const std::string& text) {
    if (what == "Application" && text == "Tessera") floats_ = true;
    const std::string line = "= " + text;
    if (what == "tessera:origin") has_origin_ = parse_triple(line, "=", origin_);
    if (what == "tessera:shift") parse_triple(line, "=", header_.shift);
    if (what == "tessera:comment" && header_.comments.size() < 100) header_.comments.push_back(text);
  }
  void take_unit(const std::string& unit) {
    static const std::map<std::string, double> kUnits = {{"micron", 1e-6},     {"millimeter", 1e-3},
                                                         {"centimeter", 1e-2}, {"inch", 0.0254},
                                                         {"foot", 0.3048},     {"meter", 1.0}};
    const auto at = kUnits.find(unit);
    if (at != kUnits.end()) header_.unit = at->second;
  }

  void place(const ModelUse& use, const ModelTransform& outer, int depth) {
    if (depth > kDeepestComponents)
      throw InputError(file_.path().string() + ": components of components of more than " +
                       std::to_string(kDeepestComponents) + " levels; an object may be part of itself");
    const auto at = index_.find(use.object);
    if (at == index_.end())
      throw InputError(file_.path().string() + ": object " + std::to_string(use.object.second) +
                       " is built, but not in the file");
    ModelObject& object = objects_[at->second];
    const ModelTransform all = use.transform.then(outer);
    if (++instances_ > kMostInstances)
      throw InputError(file_.path().string() + ": more than " + std::to_string(kMostInstances) +
                       " copies of objects are built");
    if (object.vertices > 0 || object.triangles > 0) object.instances.push_back(all);
    for (const ModelUse& component : object.components) place(component, all, depth + 1);
  }

  void place_objects() {
    for (const ModelUse& item : items_) place(item, {}, 0);
    std::size_t unused = 0;
    for (const ModelObject& o : objects_) {
      layers_ = std::max(layers_, o.instances.size());
      unused += o.instances.empty() && o.triangles > 0;
    }
    for (std::size_t layer = 0; layer < layers_; ++layer)
      for (ModelObject& o : objects_)
        if (layer < o.instances.size()) {
          o.first_vertex.push_back(vertices_);
          vertices_ += o.vertices;
          header_.faces += o.triangles;
        }
    header_.vertices = vertices_;
    bool moved = false;
    for (const ModelObject& o : objects_)
      for (const ModelTransform& t : o.instances) moved = moved || !t.identity;
    header_.double_positions = !floats_ || has_origin_ || moved;
    if (unused > 0)
      warnings_.push_back(std::to_string(unused) + " objects of the file are not built and left out");
  }

  /// Streams all parts once for each layer. begin(object, instance) comes before the elements of an object that has so many
  /// instances, end() before those of others.
  void each_instance(const std::function<void(const ModelObject&, std::size_t)>& begin,
                     const std::function<void(ModelEvents&)>& listen,
                     const std::function<void()>& end) const {
    for (std::size_t layer = 0; layer < layers_; ++layer) {
      std::set<std::string> seen;
      for (const std::string& name : parts_) {
        if (!seen.insert(name).second) continue;
        ModelEvents events;
        events.floats = floats_;
        events.object = [&](const ObjectName& object) {
          const ModelObject& o = objects_[index_.at(object)];
          layer < o.instances.size() ? begin(o, layer) : end();
        };
        listen(events);
        end();
        ModelPart model(where(name), name, events);
        parse(part(name), model);
      }
    }
  }

  const ReadFile file_;
  const MeshReadOptions options_;
  const ZipArchive archive_;
  MeshHeader header_;
  const std::string format_ = "3MF";
  std::vector<std::string> parts_;
  std::vector<ModelObject> objects_;  ///< in the order of parts and of the text
  std::map<ObjectName, std::size_t> index_;
  std::vector<ModelUse> items_;
  std::vector<std::string> warnings_;
  std::size_t components_ = 0, instances_ = 0, layers_ = 0;
  std::uint64_t vertices_ = 0;
  Double3 origin_ = {0, 0, 0};
  bool floats_ = false, has_origin_ = false;
  std::string at_;  ///< object at hand
};

}  // namespace

std::unique_ptr<MeshReader> open_threemf_mesh(ReadFile file, const MeshReadOptions& options) {
  return std::make_unique<ThreemfMeshReader>(std::move(file), options);
}

}  // namespace tessera

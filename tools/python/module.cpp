// The Python module, tessera._tessera: arrays in and out, jobs, readers. tools/python/tessera/__init__.py is what people see.
#include <pybind11/numpy.h>
#include <pybind11/pybind11.h>
#include <pybind11/stl.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <cmath>
#include <cstring>
#include <deque>
#include <exception>
#include <functional>
#include <limits>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "kernels/holes/boundary_loops.h"
#include "kernels/holes/hole_filling.h"
#include "kernels/mesh/closest_face.h"
#include "kernels/mesh/make_block.h"
#include "kernels/mesh/triangle_foot.h"
#include "kernels/solid/triangle_windings.h"
#include "octree/error.h"
#include "stream/api/arrays_call.h"
#include "stream/api/check_call.h"
#include "stream/api/job_call.h"
#include "stream/files/json.h"
#include "stream/formats/meshes/mesh_arrays.h"
#include "stream/formats/meshes/mesh_io.h"
#include "stream/formats/points/point_source.h"
#include "stream/runtime/long_call.h"
#include "stream/runtime/memory_budget.h"
#include "stream/runtime/parallel.h"
#include "tools/python/patient_call.h"

namespace py = pybind11;

namespace tessera::python {
namespace {

using Face = std::array<std::uint32_t, 3>;
template <class T>
using Array = py::array_t<T, py::array::c_style | py::array::forcecast>;

/// Numbers that Python owns from now on, without a copy. \param width  columns; 1: a plain vector
template <class T, class Element>
py::array_t<T> handed_over(std::vector<Element>&& elements, std::size_t width) {
  static_assert(sizeof(Element) % sizeof(T) == 0);
  auto owner = std::make_unique<std::vector<Element>>(std::move(elements));
  const auto* first = reinterpret_cast<const T*>(owner->data());
  const std::size_t numbers = owner->size() * sizeof(Element) / sizeof(T);
  py::capsule keep(owner.release(), [](void* p) { delete static_cast<std::vector<Element>*>(p); });
  if (width == 1) return py::array_t<T>(static_cast<py::ssize_t>(numbers), first, keep);
  return py::array_t<T>({static_cast<py::ssize_t>(numbers / width), static_cast<py::ssize_t>(width)}, first,
                        keep);
}

void require_columns(const py::array& array, py::ssize_t columns, const char* name) {
  if (array.ndim() != 2 || array.shape(1) != columns)
    throw UsageError(std::string(name) + ": an array of shape (n, " + std::to_string(columns) +
                     ") is needed");
}

/// Rows of an array as they lie in memory.
template <class Element, class T>
std::span<const Element> rows_of(const Array<T>& array, const char* name) {
  require_columns(array, static_cast<py::ssize_t>(sizeof(Element) / sizeof(T)), name);
  return {reinterpret_cast<const Element*>(array.data()), static_cast<std::size_t>(array.shape(0))};
}

py::dict dict_of(const JobProgress& p) {
  using namespace pybind11::literals;
  return py::dict("stage"_a = p.stage, "stage_index"_a = p.stage_index, "stages"_a = p.stages,
                  "unit"_a = p.unit, "done"_a = p.done, "total"_a = p.total, "seconds"_a = p.seconds,
                  "stage_done"_a = p.stage_done);
}

/// The options of a job and of how it runs, apart.
std::pair<Json, Json> split_options(const std::string& text) {
  RunOptions run;
  const OptionTable of_run = option_table(run);
  Json options = Json::object(), how = Json::object();
  const Json given = parse_json(text);
  for (const auto& [key, value] : given.items()) (of_run.find(key) != nullptr ? how : options)[key] = value;
  return {options, how};
}

/// Runs a job while Python waits: `call` gets what its progress goes to.
void run_patiently(const std::function<void(const ProgressCall&)>& call, const py::object& progress) {
  std::atomic<bool> go_on{true};
  std::mutex mutex;
  std::deque<JobProgress> news;
  const auto tell = [&] {
    std::deque<JobProgress> fresh;
    {
      const std::lock_guard lock(mutex);
      fresh.swap(news);
    }
    if (progress.is_none()) return;
    for (std::size_t i = 0; i < fresh.size(); ++i)
      if (fresh[i].stage_done || i + 1 == fresh.size()) progress(dict_of(fresh[i]));
  };
  PatientCall::run(
      [&] {
        call([&](const JobProgress& p) {
          const std::lock_guard lock(mutex);
          news.push_back(p);
          return go_on.load();
        });
      },
      tell, [&] { go_on = false; });
}

std::string run_job_by_name(const std::string& name, const std::vector<std::string>& inputs,
                            const std::string& output, const std::string& options,
                            const py::object& progress) {
  const auto [of_job, of_run] = split_options(options);
  JobRequest request = request_job(name, of_job, inputs);
  option_table(request.state.run).from_json(of_run);
  request.state.output = output;
  std::string report;
  run_patiently([&](const ProgressCall& note) { report = dump_json(call_job(request, note)); }, progress);
  return report;
}

/// Runs `use` with the faces as they lie in memory; other types of whole numbers than of 32 and 64 bits are copied.
template <class Use>
void with_face_rows(const py::array& faces, const Use& use) {
  require_columns(faces, 3, "faces");
  const auto rows = [&]<class T>(T) {
    const auto array = Array<T>::ensure(faces);
    if (!array) throw py::error_already_set();
    use(FaceRows(rows_of<std::array<T, 3>>(array, "faces")));
  };
  const char kind = faces.dtype().kind();
  if (kind != 'i' && kind != 'u') throw UsageError("faces: whole numbers are needed");
  if (faces.itemsize() <= 4 && kind == 'u') return rows(std::uint32_t{});
  if (faces.itemsize() <= 4) return rows(std::int32_t{});
  if (kind == 'u') return rows(std::uint64_t{});
  rows(std::int64_t{});
}

py::tuple run_on_arrays_by_name(const std::string& name, const Array<double>& positions,
                                const py::array& faces, const std::string& options,
                                const py::object& progress) {
  const auto [of_job, of_run] = split_options(options);
  JobRequest request = request_on_arrays(name, of_job);
  option_table(request.state.run).from_json(of_run);
  const auto vertices = rows_of<Double3>(positions, "vertices");
  ArraysResult result;
  with_face_rows(faces, [&](const FaceRows& rows) {
    run_patiently(
        [&](const ProgressCall& note) { result = call_on_arrays(MeshArrays(vertices, rows), request, note); },
        progress);
  });
  return py::make_tuple(handed_over<double>(std::move(result.mesh.vertices), 3),
                        handed_over<std::uint64_t>(std::move(result.mesh.faces), 3),
                        dump_json(result.report));
}

std::string check(const std::string& mesh, bool crossings, const std::string& reference, double tolerance,
                  std::uint64_t memory, int threads, const std::string& temp) {
  CheckCall call;
  call.mesh = mesh;
  call.options.crossings = crossings;
  call.reference = reference;
  call.compare.tolerance = tolerance;
  call.how.memory_bytes = memory;
  call.how.threads = threads;
  call.how.temp = temp;
  std::atomic<bool> go_on{true};
  call.go_on = [&] { return go_on.load(); };
  std::string report;
  PatientCall::run([&] { report = dump_json(call.run()); }, [] {}, [&] { go_on = false; });
  return report;
}

py::dict dict_of(PointChunk&& chunk) {
  py::dict out;
  const std::size_t n = chunk.size();
  std::vector<Double3> position(n);
  for (std::size_t i = 0; i < n; ++i) position[i] = {chunk.x[i], chunk.y[i], chunk.z[i]};
  out["position"] = handed_over<double>(std::move(position), 3);
  if (!chunk.nx.empty()) {
    std::vector<Float3> normal(n);
    for (std::size_t i = 0; i < n; ++i) normal[i] = {chunk.nx[i], chunk.ny[i], chunk.nz[i]};
    out["normal"] = handed_over<float>(std::move(normal), 3);
  }
  if (!chunk.rgba.empty()) out["rgba"] = handed_over<std::uint8_t>(std::move(chunk.rgba), 4);
  if (!chunk.intensity.empty()) out["intensity"] = handed_over<std::uint16_t>(std::move(chunk.intensity), 1);
  if (!chunk.echo.empty()) {
    std::vector<std::uint8_t> kind(n), number(n), of(n);
    for (std::size_t i = 0; i < n; ++i)
      kind[i] = chunk.echo[i].kind, number[i] = chunk.echo[i].number, of[i] = chunk.echo[i].of;
    out["classification"] = handed_over<std::uint8_t>(std::move(kind), 1);
    out["return_number"] = handed_over<std::uint8_t>(std::move(number), 1);
    out["returns"] = handed_over<std::uint8_t>(std::move(of), 1);
  }
  return out;
}

/// Points of files, in chunks of one size but for the last.
class PointIterator {
 public:
  PointIterator(const std::vector<std::string>& inputs, std::size_t chunk)
      : queue_(std::make_unique<PieceQueue<PointChunk>>(
            [files = expand_inputs(inputs), chunk](const std::function<void(PointChunk&&)>& put) {
              constexpr std::uint64_t kSliceBytes = std::uint64_t{16} << 20;
              PointChunk collected;
              for (const auto& path : files) {
                ReadOptions options;
                options.intensities = true;
                const auto file = open_point_file(path, options);
                for (const InputSlice& slice : file->slices(0, kSliceBytes))
                  file->read(slice, [&](const PointChunk& read) {
                    // A file that lacks an attribute ends the chunk: every array is as long as the positions.
                    if (collected.size() > 0 && !alike(collected, read)) put(std::exchange(collected, {}));
                    for (std::size_t i = 0; i < read.size(); ++i) {
                      collected.append(read, i);
                      if (collected.size() == chunk) put(std::exchange(collected, {}));
                    }
                  });
              }
              if (collected.size() > 0) put(std::move(collected));
            })) {}
  py::dict next() {
    std::optional<PointChunk> chunk = queue_->take();
    if (!chunk) throw py::stop_iteration();
    return dict_of(std::move(*chunk));
  }

 private:
  static bool alike(const PointChunk& a, const PointChunk& b) {
    return a.nx.empty() == b.nx.empty() && a.rgba.empty() == b.rgba.empty() &&
           a.intensity.empty() == b.intensity.empty() && a.echo.empty() == b.echo.empty();
  }
  std::unique_ptr<PieceQueue<PointChunk>> queue_;
};

/// A piece of a mesh file: vertices first, then faces.
struct MeshPiece {
  std::vector<Double3> position;
  std::vector<std::uint32_t> rgba;
  std::vector<MeshFace> faces;
};

/// Vertices or faces of a mesh file, in chunks of one size but for the last.
class MeshIterator {
 public:
  MeshIterator(const std::string& path, std::size_t chunk, bool of_faces) : of_faces_(of_faces) {
    std::shared_ptr<MeshReader> reader = open_mesh_file(path);
    queue_ = std::make_unique<PieceQueue<MeshPiece>>([reader, chunk, of_faces](
                                                         const std::function<void(MeshPiece &&)>& put) {
      MeshPiece collected;
      if (of_faces)
        reader->read_faces([&](std::span<const MeshFace> faces) {
          for (const MeshFace& face : faces) {
            collected.faces.push_back(face);
            if (collected.faces.size() == chunk) put(std::exchange(collected, {}));
          }
        });
      else
        reader->read_vertices([&](std::span<const Double3> positions, std::span<const std::uint32_t> rgba) {
          for (std::size_t i = 0; i < positions.size(); ++i) {
            collected.position.push_back(positions[i]);
            if (!rgba.empty()) collected.rgba.push_back(rgba[i]);
            if (collected.position.size() == chunk) put(std::exchange(collected, {}));
          }
        });
      if (!collected.faces.empty() || !collected.position.empty()) put(std::move(collected));
    });
  }
  py::object next() {
    std::optional<MeshPiece> piece = queue_->take();
    if (!piece) throw py::stop_iteration();
    if (of_faces_) return handed_over<std::uint64_t>(std::move(piece->faces), 3);
    return handed_over<double>(std::move(piece->position), 3);
  }

 private:
  bool of_faces_;
  std::unique_ptr<PieceQueue<MeshPiece>> queue_;
};

py::tuple read_mesh(const std::string& path) {
  std::vector<Double3> position;
  std::vector<std::uint32_t> rgba;
  std::vector<MeshFace> faces;
  {
    const py::gil_scoped_release free;
    const auto reader = open_mesh_file(path);
    position.reserve(reader->header().vertices);
    faces.reserve(reader->header().faces);
    reader->read_vertices([&](std::span<const Double3> p, std::span<const std::uint32_t> c) {
      position.insert(position.end(), p.begin(), p.end());
      rgba.insert(rgba.end(), c.begin(), c.end());
    });
    reader->read_faces([&](std::span<const MeshFace> f) { faces.insert(faces.end(), f.begin(), f.end()); });
  }
  py::object colours = py::none();
  if (!rgba.empty()) colours = handed_over<std::uint8_t>(std::move(rgba), 4);
  return py::make_tuple(handed_over<double>(std::move(position), 3),
                        handed_over<std::uint64_t>(std::move(faces), 3), colours);
}

void write_mesh(const std::string& path, const Array<double>& positions, const py::array& faces,
                const std::optional<Array<std::uint8_t>>& rgba) {
  const auto vertices = rows_of<Double3>(positions, "vertices");
  std::span<const std::uint32_t> colours;
  if (rgba) colours = rows_of<std::uint32_t>(*rgba, "rgba");
  if (rgba && colours.size() != vertices.size())
    throw UsageError("rgba: one colour for every vertex is needed");
  with_face_rows(faces, [&](const FaceRows& rows) {
    const py::gil_scoped_release free;
    const MeshArrays mesh(vertices, rows);
    MeshHeader header = mesh.header();
    header.colour = rgba.has_value();
    const auto writer = create_mesh_file(path, header);
    const auto reader = mesh.open();
    std::size_t at = 0;
    reader->read_vertices([&](std::span<const Double3> batch, std::span<const std::uint32_t>) {
      writer->vertices(batch, rgba ? colours.subspan(at, batch.size()) : colours);
      at += batch.size();
    });
    reader->read_faces([&](std::span<const MeshFace> batch) { writer->faces(batch); });
    writer->finish();
  });
}

Double3 middle_of(std::span<const Double3> positions) {
  if (positions.empty()) return {};
  Double3 low = positions[0], high = positions[0];
  for (const Double3& p : positions)
    for (std::size_t k = 0; k < 3; ++k) low[k] = std::min(low[k], p[k]), high[k] = std::max(high[k], p[k]);
  return (low + high) * 0.5;
}

void require_faces(std::span<const Face> faces, std::size_t vertices) {
  for (std::size_t f = 0; f < faces.size(); ++f)
    for (const std::uint32_t v : faces[f])
      if (v >= vertices)
        throw InputError("face " + std::to_string(f) + " names vertex " + std::to_string(v) + " of " +
                         std::to_string(vertices));
}

py::tuple closest_points(const Array<double>& positions, const Array<std::uint32_t>& triangles,
                         const Array<double>& queries) {
  const auto vertices = rows_of<Double3>(positions, "vertices");
  const auto faces = rows_of<Face>(triangles, "faces");
  const auto points = rows_of<Double3>(queries, "points");
  require_faces(faces, vertices.size());
  if (faces.empty()) throw EmptyError("a mesh without faces has no closest points");
  std::vector<Double3> foot(points.size());
  std::vector<std::uint32_t> face(points.size());
  std::vector<double> distance(points.size());
  {
    const py::gil_scoped_release free;
    const Double3 origin = middle_of(vertices);
    const ClosestFaces closest(vertices, faces, origin);
    std::uint32_t hint = ClosestFaces::kNone;
    for (std::size_t i = 0; i < points.size(); ++i) {
      const Double3 p = points[i] - origin;
      const auto hit = closest.closest(p, std::numeric_limits<double>::infinity(), hint);
      if (hit.slot == ClosestFaces::kNone) throw InputError("point " + std::to_string(i) + " is not finite");
      hint = hit.slot;
      face[i] = closest.face(hit.slot);
      const auto corner = closest.corners(hit.slot);
      const Double3 at = foot_in_triangle(p, corner[0], corner[1], corner[2]).at;
      foot[i] = at + origin;
      distance[i] = norm(p - at);
    }
  }
  return py::make_tuple(handed_over<double>(std::move(foot), 3),
                        handed_over<std::uint32_t>(std::move(face), 1),
                        handed_over<double>(std::move(distance), 1));
}

py::array_t<double> winding_number(const Array<double>& positions, const Array<std::uint32_t>& triangles,
                                   const Array<double>& queries) {
  const auto vertices = rows_of<Double3>(positions, "vertices");
  const auto faces = rows_of<Face>(triangles, "faces");
  const auto points = rows_of<Double3>(queries, "points");
  require_faces(faces, vertices.size());
  std::vector<double> out(points.size());
  {
    const py::gil_scoped_release free;
    const TriangleWindings windings(vertices, faces);
    for (std::size_t i = 0; i < points.size(); ++i) out[i] = windings.at(points[i]);
  }
  return handed_over<double>(std::move(out), 1);
}

/// Fills boundary loops of at most `longest` edges, the outer border of a piece left alone.
py::tuple fill_holes(const Array<double>& positions, const Array<std::uint32_t>& triangles,
                     std::uint32_t longest) {
  const auto given = rows_of<Double3>(positions, "vertices");
  const auto given_faces = rows_of<Face>(triangles, "faces");
  std::vector<Double3> vertices(given.begin(), given.end());
  std::vector<Face> faces(given_faces.begin(), given_faces.end());
  std::map<std::string, std::uint64_t> report = {{"loops", 0}, {"filled", 0},       {"taken", 0},
                                                 {"wide", 0},  {"sharp", 0},        {"outer", 0},
                                                 {"long", 0},  {"new_vertices", 0}, {"new_faces", 0}};
  {
    const py::gil_scoped_release free;
    static_cast<void>(make_block(given, given_faces));  // refuses what is no mesh
    const Double3 origin = middle_of(given);
    std::vector<EdgeRecord> records;
    for (const Face& f : given_faces)
      for (std::size_t k = 0; k < 3; ++k)
        records.push_back(edge_record(f[k], f[(k + 1) % 3], f[(k + 2) % 3]));
    std::sort(records.begin(), records.end());
    BoundaryMatcher matcher;
    for (const EdgeRecord& record : records) matcher.add(record);
    matcher.finish();
    std::uint64_t looked_at = 0;
    const LoopCounts counts =
        for_each_boundary_loop(matcher, std::min(longest, kMaxHoleEdges), [&](HoleBoundary&& boundary) {
          ++looked_at;
          HoleLoop loop;
          for (std::size_t i = 0; i < boundary.vertex.size(); ++i) {
            loop.position.push_back(given[boundary.vertex[i]] - origin);
            loop.opposite.push_back(given[boundary.third[i]] - origin);
          }
          loop.taken = boundary.taken;
          const HoleFilling filling = fill_hole(loop);
          static constexpr const char* kOutcomes[] = {"filled", "taken", "wide", "sharp", "outer"};
          ++report[kOutcomes[static_cast<std::size_t>(filling.outcome)]];
          if (filling.outcome != HoleOutcome::kFilled) return;
          const std::size_t n = boundary.vertex.size();
          const auto first = static_cast<std::uint32_t>(vertices.size());
          for (const Double3& p : filling.position) vertices.push_back(p + origin);
          for (const Face& f : filling.faces) {
            Face made;
            for (std::size_t k = 0; k < 3; ++k)
              made[k] = f[k] < n ? static_cast<std::uint32_t>(boundary.vertex[f[k]])
                                 : first + static_cast<std::uint32_t>(f[k] - n);
            faces.push_back(made);
          }
        });
    report["loops"] = counts.loops;
    report["long"] = counts.loops - looked_at;
    report["new_vertices"] = vertices.size() - given.size();
    report["new_faces"] = faces.size() - given_faces.size();
  }
  return py::make_tuple(handed_over<double>(std::move(vertices), 3),
                        handed_over<std::uint32_t>(std::move(faces), 3), report);
}

/// tessera.Error with `code`, the exit code of the program, and a class for each.
void register_errors(py::module_& m) {
  static std::map<int, py::object> classes;
  const py::object error = py::module_::import("builtins").attr("Exception");
  const auto make = [&](const char* name, const py::object& base, int code, const char* doc) {
    py::dict members;
    members["code"] = code;
    members["__doc__"] = doc;
    members["__module__"] = "tessera";
    const py::object type = py::module_::import("builtins").attr("type")(name, py::make_tuple(base), members);
    m.attr(name) = type;
    return type;
  };
  const py::object base =
      make("Error", error, 70, "What Tessera refuses; `code` is the exit code of the program.");
  classes[2] = make("UsageError", base, 2, "Options that make no sense.");
  classes[3] = make("InputError", base, 3, "Input unreadable or invalid.");
  classes[4] = make("ResourceError", base, 4, "Memory cap or disk cannot suffice.");
  classes[5] = make("EmptyError", base, 5, "Nothing to output.");
  classes[6] = make("ValidationError", base, 6, "Tolerance or validation failed.");
  classes[7] = make("StoppedError", base, 7, "Stopped before the end; the same call goes on.");
  py::register_exception_translator([](std::exception_ptr p) {
    try {
      if (p) std::rethrow_exception(p);
    } catch (const tessera::Error& e) {
      PyErr_SetString(classes.at(static_cast<int>(e.code())).ptr(), e.what());
    }
  });
  // Objects of Python must be gone before the interpreter is.
  py::module_::import("atexit").attr("register")(py::cpp_function([] { classes.clear(); }));
}

}  // namespace

PYBIND11_MODULE(_tessera, m) {
  m.doc() = "Tessera's floors for Python; use the package tessera.";
  m.attr("__version__") = TESSERA_VERSION;
  configure_allocator(core_count());  // as the program does, first thing
  register_errors(m);
  m.def("run_job", &run_job_by_name);
  m.def("run_on_arrays", &run_on_arrays_by_name);
  m.def("check", &check);
  m.def("read_mesh", &read_mesh);
  m.def("write_mesh", &write_mesh, py::arg("path"), py::arg("vertices"), py::arg("faces"),
        py::arg("rgba") = py::none());
  m.def("closest_points", &closest_points);
  m.def("winding_number", &winding_number);
  m.def("fill_holes", &fill_holes);
  m.def("work_left_behind", &work_left_behind);
  py::class_<PointIterator>(m, "PointIterator")
      .def(py::init<const std::vector<std::string>&, std::size_t>())
      .def("__iter__", [](py::object self) { return self; })
      .def("__next__", &PointIterator::next);
  py::class_<MeshIterator>(m, "MeshIterator")
      .def(py::init<const std::string&, std::size_t, bool>())
      .def("__iter__", [](py::object self) { return self; })
      .def("__next__", &MeshIterator::next);
}

}  // namespace tessera::python

#include "stream/formats/meshes/mesh_arrays.h"

#include <algorithm>
#include <string>
#include <type_traits>
#include <utility>

#include "octree/error.h"
#include "stream/files/job_scope.h"

namespace tessera {
namespace {

constexpr std::size_t kArrayBatch = 65536;

template <class Index>
void require_vertices(FaceSpan<Index> faces, std::size_t vertices) {
  for (const auto& face : faces)
    for (const Index v : face) {
      // A negative number is larger than any count.
      if (static_cast<std::uint64_t>(v) < vertices) continue;
      throw InputError("face " + std::to_string(&face - faces.data()) + " names vertex " + std::to_string(v) +
                       " of " + std::to_string(vertices));
    }
}

bool are_floats(std::span<const Double3> positions) {
  return std::all_of(positions.begin(), positions.end(), [](const Double3& p) {
    return std::all_of(p.begin(), p.end(),
                       [](double x) { return static_cast<double>(static_cast<float>(x)) == x; });
  });
}

class ArraysReader : public MeshReader {
 public:
  ArraysReader(std::span<const Double3> vertices, const FaceRows& faces, const MeshHeader& header)
      : vertices_(vertices), faces_(faces), header_(header) {}

  const MeshHeader& header() const override { return header_; }
  const std::string& format() const override { return format_; }

  void read_vertices(
      const std::function<void(std::span<const Double3>, std::span<const std::uint32_t>)>& sink) override {
    for (std::size_t at = 0; at < vertices_.size(); at += kArrayBatch)
      sink(vertices_.subspan(at, std::min(kArrayBatch, vertices_.size() - at)), {});
  }

  void read_faces(const std::function<void(std::span<const MeshFace>)>& sink) override {
    std::visit([&](const auto& faces) { read_rows(faces, sink); }, faces_);
  }

 private:
  template <class Index>
  static void read_rows(FaceSpan<Index> faces, const std::function<void(std::span<const MeshFace>)>& sink) {
    std::vector<MeshFace> batch;
    for (std::size_t at = 0; at < faces.size(); at += kArrayBatch) {
      const auto rows = faces.subspan(at, std::min(kArrayBatch, faces.size() - at));
      if constexpr (std::is_same_v<Index, std::uint64_t>) {
        sink(rows);
      } else {
        batch.resize(rows.size());
        std::transform(rows.begin(), rows.end(), batch.begin(), [](const auto& row) {
          return MeshFace{static_cast<std::uint64_t>(row[0]), static_cast<std::uint64_t>(row[1]),
                          static_cast<std::uint64_t>(row[2])};
        });
        sink(batch);
      }
    }
  }

  std::span<const Double3> vertices_;
  FaceRows faces_;
  MeshHeader header_;
  std::string format_ = "arrays";
};

class ArraysWriter : public MeshWriter {
 public:
  ArraysWriter(MadeMesh& made, const MeshHeader& header) : made_(made), header_(header) {
    made_ = {};
    made_.vertices.reserve(header.vertices);
    made_.faces.reserve(header.faces);
  }

  void vertices(std::span<const Double3> positions, std::span<const std::uint32_t>) override {
    if (header_.double_positions) {
      made_.vertices.insert(made_.vertices.end(), positions.begin(), positions.end());
      return;
    }
    for (const Double3& p : positions) made_.vertices.push_back(wide(narrow(p)));
  }
  void faces(std::span<const MeshFace> faces, std::span<const std::uint8_t>) override {
    made_.faces.insert(made_.faces.end(), faces.begin(), faces.end());
  }
  void finish() override {
    if (made_.vertices.size() != header_.vertices || made_.faces.size() != header_.faces)
      throw ValidationError("arrays: " + std::to_string(made_.vertices.size()) + " vertices and " +
                            std::to_string(made_.faces.size()) + " faces were made, " +
                            std::to_string(header_.vertices) + " and " + std::to_string(header_.faces) +
                            " announced");
  }
  std::uint64_t bytes_written() const override {
    return made_.vertices.size() * sizeof(Double3) + made_.faces.size() * sizeof(MeshFace);
  }
  MeshRounding rounding() const override { return {}; }

 private:
  MadeMesh& made_;
  MeshHeader header_;
};

}  // namespace

MeshArrays::MeshArrays(std::span<const Double3> vertices, FaceRows faces)
    : vertices_(vertices), faces_(std::move(faces)) {
  header_.vertices = vertices.size();
  header_.faces = std::visit([](const auto& rows) { return rows.size(); }, faces_);
  std::visit([&](const auto& rows) { require_vertices(rows, vertices.size()); }, faces_);
  header_.double_positions = !are_floats(vertices);
}

std::unique_ptr<MeshReader> MeshArrays::open() const {
  return std::make_unique<ArraysReader>(vertices_, faces_, header_);
}

std::unique_ptr<MeshWriter> collect_mesh(MadeMesh& made, const MeshHeader& header) {
  return std::make_unique<ArraysWriter>(made, header);
}

const MeshArrays* given_arrays(const std::filesystem::path& input) {
  const auto job = current_job();
  if (job == nullptr) return nullptr;
  const auto found = job->given.find(input);
  return found == job->given.end() ? nullptr : found->second;
}

MadeMesh* made_arrays(const std::filesystem::path& output) {
  const auto job = current_job();
  if (job == nullptr) return nullptr;
  const auto found = job->made.find(output);
  return found == job->made.end() ? nullptr : found->second;
}

}  // namespace tessera

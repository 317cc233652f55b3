/// Stage "corners" of an import: faces get their corners by number and go to the bucket of each corner.
#include <algorithm>

#include "octree/error.h"
#include "stream/files/bucket_file.h"
#include "stream/files/durable_file.h"
#include "stream/files/json.h"
#include "stream/files/spill_file.h"
#include "stream/import/import_bytes.h"
#include "stream/import/import_stages.h"
#include "stream/runtime/serial_stage.h"

namespace tessera {
namespace {

constexpr std::uint32_t kNoVertex = 0xffffffffu;

class ImportCornersStage : public SerialStage {
 public:
  ImportCornersStage(const JobState& state, ImportSource source)
      : work_(state.work),
        path_(source.path(state)),
        run_(state.run),
        source_(std::move(source)),
        names_(source_.folder),
        vertices_(state.work, source_.folder) {}

  std::string name() const override { return source_.folder + "-corners"; }
  std::uint64_t units() const override { return 0; }
  std::string unit_name() const override { return "faces"; }
  std::uint64_t finish_bytes() const override {
    return import_corners_bytes(run_, vertices_.plan().file_vertices);
  }

  Json finish(const std::vector<Json>&, TaskContext& context) const override {
    const auto mesh = open_mesh_file(path_, {.keep_bad_faces = true, .temp = work_});
    Dealer dealer(vertices_, context.create(names_.dealt_faces()));
    // Where the numbers of all vertices do not fit at once, range by range over the faces: corners that are
    // known wait in a temporary file.
    const std::uint64_t total = vertices_.plan().file_vertices;
    if (vertices_.count() >= kSyntheticCorner)
      throw InputError(path_.string() + ": more than 2^31 vertices: split the mesh first");
    std::vector<std::uint32_t> number(range());
    std::unique_ptr<SpillFile> before;
    for (std::uint64_t begin = 0; begin < total; begin += range()) {
      const std::uint64_t end = std::min(total, begin + range());
      load_numbers(begin, end, number, context);
      const bool last = end == total;
      auto after = std::make_unique<SpillFile>(work_);
      std::uint64_t at = 0;
      std::vector<RepairFace> known;
      mesh->read_flagged_faces([&](std::span<const MeshFace> faces, std::span<const std::uint8_t> synthetic) {
        context.check_stop();
        known.assign(faces.size(), {kNoVertex, kNoVertex, kNoVertex});
        if (before) before->read_at(at * sizeof(RepairFace), known.data(), known.size() * sizeof(RepairFace));
        at += faces.size();
        for (std::size_t f = 0; f < faces.size(); ++f)
          for (std::size_t c = 0; c < 3; ++c) {
            const std::uint64_t v = faces[f][c];
            if (v >= begin && v < end) known[f][c] = number[v - begin];
          }
        if (last) {
          for (std::size_t f = 0; f < known.size(); ++f)
            dealer.add(known[f], !synthetic.empty() && synthetic[f] != 0);
        } else {
          after->append(known.data(), known.size() * sizeof(RepairFace));
        }
        context.count_read(faces.size() * sizeof(RepairFace));
      });
      before = std::move(after);
    }
    context.count_written(dealer.finish());
    return {{"faces", dealer.faces},
            {"bad_faces", dealer.bad},
            {"degenerate_faces", dealer.degenerate},
            {"dealt", dealer.dealt},
            {"warnings", mesh->warnings()}};
  }

  std::vector<std::string> obsolete() const override {
    std::vector<std::string> names;
    for (std::size_t b = 0; b < vertices_.plan().buckets(); ++b) names.push_back(names_.numbers(b));
    if (!source_.work_file.empty()) names.push_back(source_.work_file);
    return names;
  }

 private:
  struct Dealer {
    Dealer(const ImportedVertices& v, const std::filesystem::path& path)
        : vertices(v), out(path, sizeof(RepairFace), v.plan().buckets(), kImportDealBytes) {}

    std::size_t bucket_of(std::uint32_t number) {
      if (number < low || number >= high) {
        last = vertices.bucket_of(number);
        low = vertices.first(last);
        high = vertices.first(last + 1);
      }
      return last;
    }
    void add(const RepairFace& f, bool synthetic) {
      ++faces;
      if (f[0] == kNoVertex || f[1] == kNoVertex || f[2] == kNoVertex) {
        ++bad;
        return;
      }
      if (f[0] == f[1] || f[1] == f[2] || f[2] == f[0]) {
        ++degenerate;
        return;
      }
      const std::size_t a = bucket_of(f[0]);
      const std::size_t b = bucket_of(f[1]);
      const std::size_t c = bucket_of(f[2]);
      const RepairFace dealt_face = {synthetic ? f[0] | kSyntheticCorner : f[0], f[1], f[2]};
      put(a, dealt_face);
      if (b != a) put(b, dealt_face);
      if (c != a && c != b) put(c, dealt_face);
    }
    void put(std::size_t bucket, const RepairFace& f) {
      out.add(bucket, &f);
      ++dealt;
    }
    std::uint64_t finish() { return out.finish(); }

    const ImportedVertices& vertices;
    BucketFileWriter out;
    std::size_t last = 0;
    std::uint32_t low = 1, high = 0;
    std::uint64_t faces = 0, bad = 0, degenerate = 0, dealt = 0;
  };

  /// Vertices whose numbers are in memory at once.
  std::uint64_t range() const { return import_corner_range(run_, vertices_.plan().file_vertices); }

  void load_numbers(std::uint64_t begin, std::uint64_t end, std::vector<std::uint32_t>& number,
                    TaskContext& context) const {
    std::fill(number.begin(), number.end(), kNoVertex);
    std::vector<DealtNumber> page(1u << 16);
    for (std::size_t b = 0; b < vertices_.plan().buckets(); ++b) {
      const ReadFile file(work_ / names_.numbers(b));
      for (std::uint64_t at = 0; at < file.size();) {
        context.check_stop();
        const std::uint64_t bytes =
            std::min<std::uint64_t>(page.size() * sizeof(DealtNumber), file.size() - at);
        file.read_at(at, page.data(), bytes);
        at += bytes;
        for (std::size_t i = 0; i < bytes / sizeof(DealtNumber); ++i)
          if (page[i].in_file >= begin && page[i].in_file < end)
            number[page[i].in_file - begin] = vertices_.first(b) + page[i].in_bucket;
      }
    }
  }

  std::filesystem::path work_;
  std::filesystem::path path_;
  RunOptions run_;
  ImportSource source_;
  ImportNames names_;
  ImportedVertices vertices_;
};

}  // namespace

std::unique_ptr<Stage> make_import_corners_stage(const JobState& state, const ImportSource& source) {
  return std::make_unique<ImportCornersStage>(state, source);
}

}  // namespace tessera

/// Stage "corners" of an import: faces get their corners by number and go to the bucket of each corner.
#include <algorithm>
#include <functional>
#include <memory>
#include <span>
#include <vector>

#include "octree/error.h"
#include "stream/files/bucket_file.h"
#include "stream/files/durable_file.h"
#include "stream/files/json.h"
#include "stream/files/spill_file.h"
#include "stream/import/file_vertices.h"
#include "stream/import/import_bytes.h"
#include "stream/import/import_ranges.h"
#include "stream/import/import_stages.h"
#include "stream/meshes/parts_at_once.h"
#include "stream/runtime/parallel.h"
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
    return import_corners_bytes(run_, vertices_.plan().file_vertices) + (lanes() - 1) * kImportLaneBytes;
  }

  Json finish(const std::vector<Json>&, TaskContext& context) const override {
    const auto mesh = open_mesh_file(path_, {.keep_bad_faces = true, .temp = work_});
    BucketFileWriter out(context.create(names_.dealt_faces()), sizeof(RepairFace), vertices_.plan().buckets(),
                         kImportDealBytes);
    // Where the numbers of all vertices do not fit at once, range by range over the faces: corners that are
    // known wait in a temporary file.
    const std::uint64_t total = vertices_.plan().file_vertices;
    if (vertices_.count() >= kSyntheticCorner)
      throw InputError(path_.string() + ": more than 2^31 vertices: split the mesh first");
    std::vector<std::uint32_t> number(range());
    std::unique_ptr<SpillFile> before;
    Tally tally;
    for (std::uint64_t begin = 0; begin < total; begin += range()) {
      const std::uint64_t end = std::min(total, begin + range());
      load_numbers(begin, end, number, context);
      const bool last = end == total;
      std::unique_ptr<SpillFile> after = last ? nullptr : std::make_unique<SpillFile>(work_);
      const Pass pass{begin, end, number, before.get(), last, context};
      read_faces(*mesh, pass, [&](const Dealt& dealt) {
        if (last) {
          dealt.write(out);
          tally.add(dealt.tally);
        } else {
          after->append(dealt.known.data(), dealt.known.size() * sizeof(RepairFace));
        }
      });
      before = std::move(after);
    }
    context.count_written(out.finish());
    return {{"faces", tally.faces},
            {"bad_faces", tally.bad},
            {"degenerate_faces", tally.degenerate},
            {"dealt", tally.dealt},
            {"warnings", mesh->warnings()}};
  }

  std::vector<std::string> obsolete() const override {
    std::vector<std::string> names;
    for (std::size_t b = 0; b < vertices_.plan().buckets(); ++b) names.push_back(names_.numbers(b));
    if (!source_.work_file.empty()) names.push_back(source_.work_file);
    return names;
  }

 private:
  struct Tally {
    std::uint64_t faces = 0, bad = 0, degenerate = 0, dealt = 0;
    void add(const Tally& other) {
      faces += other.faces;
      bad += other.bad;
      degenerate += other.degenerate;
      dealt += other.dealt;
    }
  };

  /// One reading of all faces.
  struct Pass {
    std::uint64_t begin, end;                  ///< of the vertices in the file whose numbers are known
    const std::vector<std::uint32_t>& number;  ///< theirs
    const SpillFile* before;                   ///< corners that earlier passes knew; none in the first
    bool last;
    TaskContext& context;
  };

  /// Faces that follow one another, on their way to their buckets.
  struct Dealt {
    std::vector<RepairFace> known;
    std::vector<RepairFace> faces;  ///< those of one bucket that follow one another together
    std::vector<BucketRun> runs;
    Tally tally;

    void write(BucketFileWriter& out) const {
      std::size_t at = 0;
      for (const BucketRun& run : runs) {
        out.add_run(run.bucket, faces.data() + at, run.count);
        at += run.count;
      }
    }
  };

  /// The bucket of numbers that mostly lie near the last one.
  class BucketSearch {
   public:
    explicit BucketSearch(const ImportedVertices& vertices) : vertices_(vertices) {}
    /// Whether a number lies in the last one.
    bool holds(std::uint32_t number) const { return number >= low_ && number < high_; }
    std::uint32_t last() const { return static_cast<std::uint32_t>(last_); }
    std::uint32_t of(std::uint32_t number) {
      if (!holds(number)) {
        last_ = vertices_.bucket_of(number);
        low_ = vertices_.first(last_);
        high_ = vertices_.first(last_ + 1);
      }
      return static_cast<std::uint32_t>(last_);
    }

   private:
    const ImportedVertices& vertices_;
    std::size_t last_ = 0;
    std::uint32_t low_ = 1, high_ = 0;
  };

  std::size_t lanes() const {
    return parts_at_once(run_, import_corners_bytes(run_, vertices_.plan().file_vertices), kImportLaneBytes);
  }

  /// Hands out what is made of the faces, in the order of the file: ranges on all threads as long as there are triangles alone,
  /// the rest as it is read.
  void read_faces(MeshReader& mesh, const Pass& pass, const std::function<void(const Dealt&)>& use) const {
    std::uint64_t first = 0;
    MeshRanges* ranges = find_ranges(mesh);
    if (ranges && mesh.header().faces > 0) {
      first = read_ranges(*ranges, mesh.header().faces, pass, use);
      if (first == mesh.header().faces) return;
    }
    Dealt dealt;
    const auto sink = [&](std::span<const MeshFace> faces, std::span<const std::uint8_t> synthetic) {
      deal_batch(pass, first, faces, synthetic, dealt);
      first += faces.size();
      use(dealt);
    };
    if (ranges) {
      ranges->read_faces_from(first, sink);
    } else {
      mesh.read_flagged_faces(sink);
    }
  }

  /// \returns how many faces were read
  std::uint64_t read_ranges(const MeshRanges& mesh, std::uint64_t count, const Pass& pass,
                            const std::function<void(const Dealt&)>& use) const {
    struct Slot {
      MeshFacePart part;
      Dealt dealt;
      std::uint64_t end = 0;
    };
    std::vector<Slot> slots(lanes());
    std::uint64_t read = 0;  // in a row
    const auto make = [&](std::size_t range) {
      Slot& slot = slots[range % slots.size()];
      const std::uint64_t begin = range * kImportRange;
      slot.end = mesh.read_face_range(begin, std::min(begin + kImportRange, count), slot.part);
      deal_batch(pass, begin, slot.part.faces, slot.part.synthetic, slot.dealt);
    };
    parallel_in_order((count + kImportRange - 1) / kImportRange, slots.size(), make, [&](std::size_t range) {
      const Slot& slot = slots[range % slots.size()];
      if (read < range * kImportRange) return;  // a face before it is no triangle
      read = slot.end;
      use(slot.dealt);
    });
    return read;
  }

  /// \param first  number of the first face in the file
  void deal_batch(const Pass& pass, std::uint64_t first, std::span<const MeshFace> faces,
                  std::span<const std::uint8_t> synthetic, Dealt& dealt) const {
    pass.context.check_stop();
    pass.context.count_read(faces.size() * sizeof(RepairFace));
    dealt.known.assign(faces.size(), {kNoVertex, kNoVertex, kNoVertex});
    if (pass.before && !faces.empty())
      pass.before->read_at(first * sizeof(RepairFace), dealt.known.data(), faces.size() * sizeof(RepairFace));
    const std::uint64_t begin = pass.begin, count = pass.end - pass.begin;
    const std::uint32_t* number = pass.number.data();
    RepairFace* known = dealt.known.data();
    for (std::size_t f = 0; f < faces.size(); ++f)
      for (std::size_t c = 0; c < 3; ++c) {
        const std::uint64_t v = faces[f][c] - begin;
        if (v < count) known[f][c] = number[v];
      }
    dealt.faces.clear();
    dealt.runs.clear();
    dealt.tally = {};
    if (!pass.last) return;
    BucketSearch bucket(vertices_);
    dealt.faces.reserve(faces.size() + faces.size() / 8);
    std::uint32_t inside = 0;  // faces of the last bucket alone
    const auto add_inside = [&] {
      if (inside == 0) return;
      add_to_runs(dealt.runs, bucket.last(), inside);
      dealt.tally.faces += inside;
      dealt.tally.dealt += inside;
      inside = 0;
    };
    for (std::size_t f = 0; f < faces.size(); ++f) {
      const RepairFace& face = dealt.known[f];
      const bool closes = !synthetic.empty() && synthetic[f] != 0;
      if (bucket.holds(face[0]) && bucket.holds(face[1]) && bucket.holds(face[2]) && face[0] != face[1] &&
          face[1] != face[2] && face[2] != face[0]) {
        dealt.faces.push_back({closes ? face[0] | kSyntheticCorner : face[0], face[1], face[2]});
        ++inside;
        continue;
      }
      add_inside();
      add_face(face, closes, bucket, dealt);
    }
    add_inside();
  }

  /// To the bucket of each corner.
  static void add_face(const RepairFace& f, bool synthetic, BucketSearch& bucket, Dealt& dealt) {
    ++dealt.tally.faces;
    if (f[0] == kNoVertex || f[1] == kNoVertex || f[2] == kNoVertex) {
      ++dealt.tally.bad;
      return;
    }
    if (f[0] == f[1] || f[1] == f[2] || f[2] == f[0]) {
      ++dealt.tally.degenerate;
      return;
    }
    const std::uint32_t a = bucket.of(f[0]), b = bucket.of(f[1]), c = bucket.of(f[2]);
    const auto put = [&](std::uint32_t to) {
      dealt.faces.push_back({synthetic ? f[0] | kSyntheticCorner : f[0], f[1], f[2]});
      add_to_runs(dealt.runs, to);
      ++dealt.tally.dealt;
    };
    put(a);
    if (b != a) put(b);
    if (c != a && c != b) put(c);
  }

  /// Vertices whose numbers are in memory at once.
  std::uint64_t range() const { return import_corner_range(run_, vertices_.plan().file_vertices); }

  void load_numbers(std::uint64_t begin, std::uint64_t end, std::vector<std::uint32_t>& number,
                    TaskContext& context) const {
    std::fill(number.begin(), number.end(), kNoVertex);
    parallel_for(vertices_.plan().buckets(), [&](std::size_t b) {
      std::vector<DealtNumber> page(1u << 13);
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
    });
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

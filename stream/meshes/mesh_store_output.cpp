#include "stream/meshes/mesh_store_output.h"

#include <algorithm>

#include "kernels/mesh/flat_faces.h"
#include "kernels/mesh/mesh_block_ops.h"
#include "octree/error.h"
#include "stream/files/external_sort.h"
#include "stream/files/spill_file.h"
#include "stream/meshes/store_output_file.h"

namespace tessera {
namespace {

/// A vertex that other patches may use, in one patch.
struct Shared {
  std::uint64_t key = 0;
  std::uint64_t patch = 0;
  auto operator<=>(const Shared&) const = default;
};
/// What a patch must know of a shared vertex: who numbers it, and in the end its number.
struct Named {
  std::uint64_t patch = 0;
  std::uint64_t key = 0;
  std::uint64_t value = 0;
  auto operator<=>(const Named&) const = default;
};
struct Number {
  std::uint64_t key = 0;
  std::uint64_t number = 0;
  auto operator<=>(const Number&) const = default;
};

/// Records written one after the other, read in the same order.
template <class Record>
class Sequence {
 public:
  explicit Sequence(const std::filesystem::path& temp) : file_(temp) {}
  void append(std::span<const Record> records) {
    if (!records.empty()) file_.append(records.data(), records.size_bytes());
  }
  bool next(Record& record) {
    if (at_ == page_.size()) {
      const std::uint64_t left = (file_.size() - offset_) / sizeof(Record);
      page_.resize(std::min<std::uint64_t>(left, 4096));
      at_ = 0;
      if (page_.empty()) return false;
      file_.read_at(offset_, page_.data(), page_.size() * sizeof(Record));
      offset_ += page_.size() * sizeof(Record);
    }
    record = page_[at_++];
    return true;
  }

 private:
  SpillFile file_;
  std::uint64_t offset_ = 0;
  std::vector<Record> page_;
  std::size_t at_ = 0;
};

class StoreWriter {
 public:
  StoreWriter(const MeshStore& store, const MeshStoreOutput& output)
      : store_(store), output_(output), shared_(output.temp), owners_(output.temp), numbers_(output.temp) {}

  MeshStoreOutputReport run(
      const std::function<std::unique_ptr<MeshWriter>(const MeshHeader& header)>& create) {
    if (store_.face_count() == 0) throw EmptyError("the mesh has no faces left: there is nothing to write");
    find_shared();
    count_vertices();
    MeshHeader header;
    header.vertices = report_.vertices;
    header.faces = report_.faces = store_.face_count();
    header.colour = store_.info().colour;
    header.synthetic = store_.has_synthetic();
    header.double_positions = store_.info().double_positions;
    header.origin = output_.origin;
    header.shift = store_.info().shift;
    header.comments = output_.comments;
    const auto file = create(header);
    write_vertices(*file);
    number_shared();
    write_faces(*file);
    file->finish();
    report_.bytes = file->bytes_written();
    report_.rounding = file->rounding();
    return report_;
  }

 private:
  void stop() const {
    if (output_.check_stop) output_.check_stop();
  }
  MeshBlock load(std::size_t patch) const {
    stop();
    return store_.load(std::vector<std::size_t>{patch});
  }

  /// A vertex whose star is not complete in its patch may be in others; the first patch of all numbers it.
  void find_shared() {
    ExternalSort<Shared> sort(output_.temp, output_.memory_bytes / 2);
    for (std::size_t p = 0; p < store_.patches().size(); ++p) {
      const MeshBlock block = load(p);
      const std::vector<std::uint8_t> complete = complete_stars(block);
      for (std::size_t v = 0; v < complete.size(); ++v)
        if (!complete[v]) sort.add({block.key[v], p});
    }
    ExternalSort<Named> by_patch(output_.temp, output_.memory_bytes / 2);
    std::uint64_t key = ~std::uint64_t{0};
    std::uint64_t owner = 0;
    sort.drain([&](std::span<const Shared> batch) {
      stop();
      shared_.append(batch);
      for (const Shared& s : batch) {
        if (s.key != key) {
          key = s.key;
          owner = s.patch;
          ++report_.shared_vertices;
        }
        by_patch.add({s.patch, s.key, owner});
      }
    });
    foreign_.assign(store_.patches().size(), 0);
    by_patch.drain([&](std::span<const Named> batch) {
      owners_.append(batch);
      for (const Named& n : batch) foreign_[n.patch] += n.value != n.patch;
    });
  }

  void count_vertices() {
    first_.assign(1, 0);
    for (std::size_t p = 0; p < store_.patches().size(); ++p)
      first_.push_back(first_.back() + store_.patches()[p].vertices - foreign_[p]);
    report_.vertices = first_.back();
  }

  void write_vertices(MeshWriter& file) {
    ExternalSort<Number> sort(output_.temp, output_.memory_bytes / 2);
    Named next;
    bool more = owners_.next(next);
    std::vector<Double3> position;
    std::vector<std::uint32_t> rgba;
    for (std::size_t p = 0; p < store_.patches().size(); ++p) {
      const MeshBlock block = load(p);
      position.clear();
      rgba.clear();
      for (std::size_t v = 0; v < block.key.size(); ++v) {
        const bool shared = more && next.patch == p && next.key == block.key[v];
        const std::uint64_t owner = shared ? next.value : p;
        if (shared) more = owners_.next(next);
        if (owner != p) continue;
        if (shared) sort.add({block.key[v], first_[p] + position.size()});
        position.push_back(block.position[v]);
        if (!block.rgba.empty()) rgba.push_back(block.rgba[v]);
      }
      file.vertices(position, rgba);
    }
    sort.drain([&](std::span<const Number> batch) { numbers_.append(batch); });
  }

  /// Both lists ascend by key.
  void number_shared() {
    ExternalSort<Named> sort(output_.temp, output_.memory_bytes / 2);
    Shared s;
    Number n;
    bool found = false;
    while (shared_.next(s)) {
      while (!found || n.key != s.key) {
        found = numbers_.next(n);
        if (!found) throw std::logic_error("mesh output: a shared vertex has no number");
      }
      sort.add({s.patch, s.key, n.number});
    }
    named_ = std::make_unique<Sequence<Named>>(output_.temp);
    sort.drain([&](std::span<const Named> batch) { named_->append(batch); });
  }

  void write_faces(MeshWriter& file) {
    Named next;
    bool more = named_->next(next);
    std::vector<std::uint64_t> number;
    std::vector<MeshFace> faces;
    std::vector<std::uint8_t> synthetic;
    for (std::size_t p = 0; p < store_.patches().size(); ++p) {
      const MeshBlock block = load(p);
      number.resize(block.key.size());
      std::uint64_t own = first_[p];
      for (std::size_t v = 0; v < block.key.size(); ++v) {
        if (more && next.patch == p && next.key == block.key[v]) {
          number[v] = next.value;
          if (number[v] == own) ++own;
          more = named_->next(next);
        } else {
          number[v] = own++;
        }
      }
      faces.clear();
      for (const auto& f : block.faces) {
        faces.push_back({number[f[0]], number[f[1]], number[f[2]]});
        report_.flat_faces +=
            face_extent(block.position[f[0]], block.position[f[1]], block.position[f[2]]).is_flat();
      }
      synthetic.clear();
      for (const std::uint8_t flags : block.face_flags) {
        if (store_.has_synthetic()) synthetic.push_back((flags & kFaceSynthetic) != 0);
        report_.synthetic_faces += (flags & kFaceSynthetic) != 0;
      }
      file.faces(faces, synthetic);
      if (output_.advance) output_.advance(faces.size());
    }
  }

  const MeshStore& store_;
  const MeshStoreOutput& output_;
  MeshStoreOutputReport report_;
  Sequence<Shared> shared_;   ///< ascending by key, then patch
  Sequence<Named> owners_;    ///< ascending by patch, then key; value: the patch that numbers it
  Sequence<Number> numbers_;  ///< ascending by key
  std::unique_ptr<Sequence<Named>> named_;  ///< ascending by patch, then key; value: the number
  std::vector<std::uint32_t> foreign_;      ///< per patch: vertices that another one numbers
  std::vector<std::uint64_t> first_;        ///< per patch: its first number
};

}  // namespace

MeshStoreOutputReport write_mesh_store(const MeshStore& store, const MeshStoreOutput& output) {
  return write_mesh_store_as(store, output,
                             [&](const MeshHeader& header) { return create_mesh_file(output.path, header); });
}

MeshStoreOutputReport write_mesh_store_as(
    const MeshStore& store, const MeshStoreOutput& output,
    const std::function<std::unique_ptr<MeshWriter>(const MeshHeader& header)>& create) {
  return StoreWriter(store, output).run(create);
}

std::uint64_t write_mesh_store_bytes(std::uint64_t patch_bytes, std::uint64_t patches,
                                     std::uint64_t sort_bytes) {
  return sort_bytes + 3 * patch_bytes + patches * 12 + (std::uint64_t{24} << 20);
}

}  // namespace tessera

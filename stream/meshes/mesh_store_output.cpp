#include "stream/meshes/mesh_store_output.h"

#include <algorithm>

#include "kernels/mesh/flat_faces.h"
#include "kernels/mesh/mesh_block_ops.h"
#include "octree/error.h"
#include "stream/files/external_sort.h"
#include "stream/files/spill_file.h"
#include "stream/formats/mesh_parts.h"
#include "stream/meshes/store_output_file.h"
#include "stream/runtime/parallel.h"

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
  /// What one patch needs on its way: first its block, then what is written of it. Slots are used again.
  struct Slot {
    MeshBlock block;
    std::vector<std::uint64_t> open;  ///< keys of vertices that other patches may use
    MeshVertexPart vertices;
    MeshFacePart faces;
    std::uint64_t flat = 0, closing = 0;
  };
  /// make(p, slot) of every patch on all threads, use(p, slot) one after the other, and after(slot) in the same order.
  template <class Make, class Use>
  void in_order(Make&& make, Use&& use, const std::function<void(Slot&)>& after = {}) {
    slots_.resize(std::max<std::size_t>(1, output_.patches_at_once));
    const auto slot = [&](std::size_t p) -> Slot& { return slots_[p % slots_.size()]; };
    std::function<void(std::size_t)> then;
    if (after) then = [&](std::size_t p) { after(slot(p)); };
    parallel_in_order(
        store_.patches().size(), slots_.size(), [&](std::size_t p) { make(p, slot(p)); },
        [&](std::size_t p) { use(p, slot(p)); }, then);
  }
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
    in_order(
        [&](std::size_t p, Slot& slot) {
          const MeshBlock block = load(p);
          const std::vector<std::uint8_t> complete = complete_stars(block);
          slot.open.clear();
          for (std::size_t v = 0; v < complete.size(); ++v)
            if (!complete[v]) slot.open.push_back(block.key[v]);
        },
        [&](std::size_t p, Slot& slot) {
          for (const std::uint64_t key : slot.open) sort.add({key, p});
        });
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
    in_order([&](std::size_t p, Slot& slot) { slot.block = load(p); },
             [&](std::size_t p, Slot& slot) {
               const MeshBlock& block = slot.block;
               MeshVertexPart& part = slot.vertices;
               for (std::size_t v = 0; v < block.key.size(); ++v) {
                 const bool shared = more && next.patch == p && next.key == block.key[v];
                 const std::uint64_t owner = shared ? next.value : p;
                 if (shared) more = owners_.next(next);
                 if (owner != p) continue;
                 if (shared) sort.add({block.key[v], first_[p] + part.position.size()});
                 part.position.push_back(block.position[v]);
                 if (!block.rgba.empty()) part.rgba.push_back(block.rgba[v]);
               }
               slot.block = {};
             },
             [&](Slot& slot) {
               file.vertices(slot.vertices.position, slot.vertices.rgba);
               slot.vertices = {};
             });
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
    const bool flagged = store_.has_synthetic();
    const auto make = [&](std::size_t p, Slot& slot) {
      slot.block = load(p);
      const MeshBlock& block = slot.block;
      slot.flat = slot.closing = 0;
      for (const auto& f : block.faces)
        slot.flat += face_extent(block.position[f[0]], block.position[f[1]], block.position[f[2]]).is_flat();
      for (const std::uint8_t flags : block.face_flags) {
        if (flagged) slot.faces.synthetic.push_back((flags & kFaceSynthetic) != 0);
        slot.closing += (flags & kFaceSynthetic) != 0;
      }
    };
    const auto use = [&](std::size_t p, Slot& slot) {
      const MeshBlock& block = slot.block;
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
      for (const auto& f : block.faces)
        slot.faces.faces.push_back({number[f[0]], number[f[1]], number[f[2]]});
      report_.flat_faces += slot.flat;
      report_.synthetic_faces += slot.closing;
      slot.block = {};
    };
    in_order(make, use, [&](Slot& slot) {
      file.faces(slot.faces.faces, slot.faces.synthetic);
      if (output_.advance) output_.advance(slot.faces.faces.size());
      slot.faces = {};
    });
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
  std::vector<Slot> slots_;
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
                                     std::uint64_t sort_bytes, std::size_t patches_at_once) {
  return sort_bytes + (2 + patches_at_once) * patch_bytes + patches * 12 + (std::uint64_t{24} << 20);
}

}  // namespace tessera

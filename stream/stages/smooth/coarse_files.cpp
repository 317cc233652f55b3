#include "stream/stages/smooth/coarse_files.h"

#include <algorithm>
#include <array>
#include <limits>

#include "octree/error.h"
#include "stream/files/read_file.h"

namespace tessera {
namespace {

using Header = std::array<std::uint64_t, 4>;  // patch, unknowns, entries, loads

std::uint64_t body_bytes(const Header& h) {
  return h[1] * sizeof(CoarseUnknown) + h[2] * sizeof(CoarseEntry) + h[3] * sizeof(CoarseLoad);
}

/// Calls sink(header, offset of the body) for every patch.
template <class Sink>
void for_each_patch(const ReadFile& file, const Sink& sink) {
  for (std::uint64_t offset = 0; offset < file.size();) {
    Header h;
    file.read_at(offset, h.data(), sizeof h);
    offset += sizeof h;
    const std::uint64_t most = file.size() / sizeof(CoarseUnknown);
    if (h[1] > most || h[2] > 2 * most || h[3] > most || body_bytes(h) > file.size() - offset)
      throw InputError(file.path().string() + ": damaged at byte " + std::to_string(offset) +
                       "; run again with --force");
    sink(h, offset);
    offset += body_bytes(h);
  }
}

template <class Record>
void write_all(DirectFile& file, const std::vector<Record>& records) {
  if (!records.empty()) file.write(records.data(), records.size() * sizeof(Record));
}

template <class Record>
void read_all(const ReadFile& file, std::uint64_t& offset, std::uint64_t count,
              std::vector<Record>& records) {
  records.resize(count);
  file.read_at(offset, records.data(), count * sizeof(Record));
  offset += count * sizeof(Record);
}

}  // namespace

std::string coarse_sums_folder(std::size_t round) {
  return "sums-" + std::to_string(round);
}
std::string coarse_folder(std::size_t round) {
  return "coarse-" + std::to_string(round);
}
std::string coarse_solution_file(std::size_t round) {
  return coarse_folder(round) + "/solution.bin";
}

std::string bend_folder(std::size_t round) {
  return "bend-" + std::to_string(round);
}

void PatchSumsWriter::add(const PatchSums& sums) {
  const Header h = {sums.patch, sums.unknowns.size(), sums.entries.size(), sums.loads.size()};
  file_.write(h.data(), sizeof h);
  write_all(file_, sums.unknowns);
  write_all(file_, sums.entries);
  write_all(file_, sums.loads);
}

PatchSumsCount count_patch_sums(const std::vector<std::filesystem::path>& files) {
  PatchSumsCount count;
  for (const auto& path : files)
    for_each_patch(ReadFile(path), [&](const Header& h, std::uint64_t) {
      count.unknowns += h[1];
      count.entries += h[2];
      count.loads += h[3];
      count.largest_patch_bytes = std::max(count.largest_patch_bytes, body_bytes(h));
    });
  return count;
}

void read_patch_sums(const std::vector<std::filesystem::path>& files,
                     const std::function<void(const PatchSums&)>& sink) {
  PatchSums sums;
  for (const auto& path : files) {
    const ReadFile file(path);
    for_each_patch(file, [&](const Header& h, std::uint64_t offset) {
      sums.patch = h[0];
      read_all(file, offset, h[1], sums.unknowns);
      read_all(file, offset, h[2], sums.entries);
      read_all(file, offset, h[3], sums.loads);
      sink(sums);
    });
  }
}

void save_coarse_solution(const std::filesystem::path& path, std::span<const CoarseUnknown> unknowns,
                          std::span<const CoarseValue> values) {
  DirectFile file(path);
  for (const CoarseUnknown& u : unknowns) file.write(&u.name, sizeof u.name);
  for (const CoarseValue& v : values) file.write(&v, sizeof v);
  file.finish();
}

CoarseSolution load_coarse_solution(const std::filesystem::path& path) {
  const ReadFile file(path);
  const std::uint64_t n = file.size() / (sizeof(std::uint64_t) + sizeof(CoarseValue));
  CoarseSolution out;
  std::uint64_t offset = 0;
  read_all(file, offset, n, out.name);
  read_all(file, offset, n, out.value);
  return out;
}

std::uint64_t coarse_solution_bytes(const std::filesystem::path& path) {
  return ReadFile(path).size();
}

void PatchBendWriter::add(std::uint64_t patch, std::span<const Float3> bend) {
  const std::array<std::uint64_t, 2> header = {patch, bend.size()};
  file_.write(header.data(), sizeof header);
  if (!bend.empty()) file_.write(bend.data(), bend.size_bytes());
}

PatchBends::PatchBends(const std::vector<std::filesystem::path>& files) {
  for (const auto& path : files) {
    const ReadFile& file = files_.emplace_back(path);
    for (std::uint64_t offset = 0; offset < file.size();) {
      std::array<std::uint64_t, 2> header{};
      file.read_at(offset, header.data(), sizeof header);
      offset += sizeof header;
      const auto [patch, count] = header;
      if (count > (file.size() - offset) / sizeof(Float3))
        throw InputError(path.string() + ": damaged at byte " + std::to_string(offset) +
                         "; run again with --force");
      places_[patch] = {files_.size() - 1, offset, count};
      offset += count * sizeof(Float3);
    }
  }
}

std::vector<Float3> PatchBends::load(std::uint64_t patch) const {
  const Place& place = places_.at(patch);
  std::vector<Float3> bend(place.count);
  files_[place.file].read_at(place.offset, bend.data(), bend.size() * sizeof(Float3));
  return bend;
}

TileState tile_state(const MeshStore& loaded, const MeshStore& store, const PatchBends& bends,
                     const MeshHaloBlock& near, const SmoothTile& tile) {
  const std::vector<std::uint64_t>& key = near.block.key;
  TileState out;
  out.now = near.block.position;
  if (!bends.empty()) out.bend.resize(key.size());
  for (const std::size_t p : loaded.select(grown(loaded.box_of(tile.patches), tile.margin))) {
    const MeshBlock patch = store.load({&p, 1});
    const std::vector<Float3> bend = bends.empty() ? std::vector<Float3>() : bends.load(p);
    auto at = key.begin();
    for (std::size_t v = 0; v < patch.key.size(); ++v) {
      at = std::lower_bound(at, key.end(), patch.key[v]);
      if (at == key.end()) break;
      if (*at != patch.key[v]) continue;
      const auto i = static_cast<std::size_t>(at - key.begin());
      out.now[i] = patch.position[v];
      if (!bend.empty()) out.bend[i] = bend[v];
    }
  }
  return out;
}

}  // namespace tessera

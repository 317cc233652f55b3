/// The surface of solids as a mesh of the job: patches by name, and the signs of the lattice beside it.
#include <cmath>

#include "stream/files/packed_file.h"
#include "stream/files/task_files.h"
#include "stream/stages/solid/solid_stages.h"

namespace tessera {
namespace {

constexpr PackedKind kSignsKind = {"TSSIGNS1", "a file of signs"};
constexpr const char* kFolder = "solid/";

}  // namespace

OffsetLayer SolidModel::layer(double h) const {
  OffsetLayer layer;
  layer.high = offset / h;
  layer.mitre = mitre;
  if (shell > 0.0) layer.low = (offset - shell) / h;
  return layer;
}

MeshStore open_solid_mesh(const std::filesystem::path& work) {
  return MeshStore(list_task_files(work / kFolder, ".tmm"));
}

SolidMeshWriter::SolidMeshWriter(const Lattice& lattice, std::size_t task, TaskContext& context)
    : frame_{lattice, {0, 0, 0}, true, false},
      mesh_(context.create(kFolder + task_file_stem(task) + ".tmm"),
            MeshStoreInfo{lattice, true, false, {0, 0, 0}}),
      signs_path_(context.create(kFolder + task_file_stem(task) + ".sgn")) {}

void SolidMeshWriter::add(const DirectedField& field) {
  append_leaf_signs(field, signs_);
}

void SolidMeshWriter::add(const Patch& patch) {
  mesh_.add(brick_key(patch.brick), make_mesh_block(patch, frame_));
}

std::uint64_t SolidMeshWriter::finish() {
  PackedWriter out(signs_path_, kSignsKind);
  const std::vector<Section> sections = {out.append(bytes_of(signs_))};
  return mesh_.finish() + out.finish(sections);
}

std::vector<LeafSigns> load_solid_signs(const std::filesystem::path& work) {
  std::vector<LeafSigns> all;
  for (const auto& path : list_task_files(work / kFolder, ".sgn")) {
    const PackedFile file(path, kSignsKind, sizeof(Section));
    for (const Section& section : file.table<Section>()) {
      const std::vector<LeafSigns> part = file.load<LeafSigns>(section);
      all.insert(all.end(), part.begin(), part.end());
    }
  }
  return all;
}

}  // namespace tessera

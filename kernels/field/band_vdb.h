/// \file band_vdb.h
/// The band as an OpenVDB grid, for people and other programs: one float grid of class level set, signed distances in
/// scan units, active where the field is valid. Its leaves are the band's own (band_leaf.h).
#pragma once
#include <cstddef>
#include <iosfwd>
#include <memory>

#include "kernels/field/directed_field.h"

namespace tessera {

/// Collects the bands of blocks in one grid. Holds all of it in memory: about 5 bytes a node.
class VdbExport {
 public:
  explicit VdbExport(const Lattice& lattice);
  ~VdbExport();
  VdbExport(const VdbExport&) = delete;
  VdbExport& operator=(const VdbExport&) = delete;

  /// Takes the leaves of a block. Blocks may overlap and come in any order: their nodes agree to the bit.
  void add(DirectedField&& field);
  [[nodiscard]] std::size_t node_count() const;
  [[nodiscard]] std::size_t bytes() const;
  /// Writes a .vdb file. \pre the stream is binary \post stream state says whether all was written
  void write(std::ostream& out) const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace tessera

/// \file copc_body.h
/// What of a COPC file lies behind its header and records: the nodes as chunks of LAZ, coarse ones first, the table of the
/// chunks, and the hierarchy as an extended record. Source: COPC 1.0 (Hobu).
#pragma once
#include <array>
#include <cstddef>
#include <cstdint>

#include "stream/files/output_file.h"
#include "stream/formats/copc/copc_nodes.h"
#include "stream/formats/laz/schema.h"

namespace tessera {

inline constexpr std::size_t kCopcInfoBytes = 160;                    ///< of the record that comes first
inline constexpr std::size_t kCopcGroupBytes = std::size_t{8} << 20;  ///< of nodes compressed at a time

struct CopcBody {
  std::uint64_t hierarchy_at = 0;           ///< offset of the extended record
  std::array<char, kCopcInfoBytes> info{};  ///< the record that comes first
};

/// Appends it, with the threads of the enclosing WorkerPool.
/// \param begin  where the offset of the chunk table stands, the last eight bytes so far
/// \param times  of points, the first and the last; 0 = unknown
/// \pre nodes.build() \throws what nodes and file do; StoppedError
CopcBody append_copc_body(OutputFile& file, const laz::Schema& schema, const CopcNodes& nodes,
                          std::uint64_t begin, const std::array<double, 2>& times);

}  // namespace tessera

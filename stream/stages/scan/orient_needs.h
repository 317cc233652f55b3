/// \file orient_needs.h
/// Memory and disk of orientation, told before there are patches.
#pragma once
#include <cstdint>

#include "stream/stages/plan/planned_scan.h"

namespace tessera {

struct OrientNeeds {
  std::uint64_t links_task = 0, links_finish = 0, links_disk = 0;
  std::uint64_t task = 0, finish = 0;
};

OrientNeeds orient_needs(const PlannedScan& scan);

}  // namespace tessera

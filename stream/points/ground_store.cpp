#include "stream/points/ground_store.h"

#include "stream/files/task_files.h"

namespace tessera {

GroundFiles<TerrainCell> open_ground_cells(const std::filesystem::path& work) {
  return {list_task_files(work / kGroundCellFolder, kGroundExtension), kGroundCellKind};
}
GroundFiles<TerrainNode> open_ground(const std::filesystem::path& work) {
  return {list_task_files(work / kGroundFolder, kGroundExtension), kGroundKind};
}

}  // namespace tessera

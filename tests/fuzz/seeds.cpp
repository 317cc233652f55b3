// Files for fuzz targets to begin from: fuzz_seeds FOLDER writes FOLDER/TARGET/0, 1, ... (tools/fuzz).
#include <filesystem>
#include <fstream>
#include <string>
#include <vector>

#include "tests/fuzz/mesh_samples.h"
#include "tests/fuzz/point_samples.h"
#include "tests/helpers/copc_file.h"
#include "tests/helpers/laz_file.h"

namespace {

using namespace tessera;

void write(const std::filesystem::path& folder, const std::vector<std::string>& files) {
  std::filesystem::create_directories(folder);
  for (std::size_t i = 0; i < files.size(); ++i)
    std::ofstream(folder / std::to_string(i), std::ios::binary) << files[i];
}

std::vector<std::string> las_and_laz() {
  std::vector<std::string> files = fuzz::las_files();
  for (const int format : {1, 3, 7}) {
    test::LazSample s;
    s.minor = format == 7 ? 4 : 2;
    s.format = format;
    s.points = 20;
    s.chunk_points = 7;
    files.push_back(test::laz_file(s, test::las_records(s)).bytes);
  }
  return files;
}

/// The first byte says which of the target's readers gets the rest.
std::vector<std::string> edits() {
  return {std::string(1, '\0') +
              R"({"regions":[{"role":"support","all":true},{"role":"fixed","vertices":[0]},)"
              R"({"role":"handle","name":"a","box":[[0,0,0],[1,1,1]]}],"handles":{"a":{"move":[0.1,0,0]}}})",
          std::string(1, '\1') + R"({"poses":[{"a":{"move":[0,0,1]}},{"a":{"rotate":[0,0,1,30]}}]})",
          std::string(1, '\2') + R"({"controls":[[0,0,0],[1,0,0]]})"};
}

std::vector<std::string> options() {
  return {std::string(1, '\0') + R"({"resolution":0.5,"tolerance":0.1})",
          std::string(1, '\1') + "memory=256M", std::string(1, '\2') + "tolerance=0.1",
          std::string(1, '\3') + R"({"edge":0.5})"};
}

}  // namespace

int main(int count, char** words) {
  if (count != 2) return 2;
  const std::filesystem::path to = words[1];
  write(to / "ply_points", fuzz::ply_files());
  write(to / "las_points", las_and_laz());
  write(to / "copc_points", {test::copc_file().bytes});
  write(to / "e57_points", fuzz::e57_files());
  write(to / "pcd_points", fuzz::pcd_files());
  write(to / "ptx_points", fuzz::ptx_files());
  write(to / "text_points", fuzz::text_files());
  write(to / "ply_mesh", fuzz::ply_meshes());
  write(to / "obj_mesh", fuzz::obj_meshes());
  write(to / "off_mesh", fuzz::off_meshes());
  write(to / "stl_mesh", fuzz::stl_meshes());
  write(to / "glb_mesh", fuzz::glb_meshes());
  write(to / "threemf_mesh", fuzz::threemf_meshes());
  write(to / "vtu_mesh", fuzz::vtu_meshes());
  write(to / "msh_mesh", fuzz::msh_meshes());
  write(to / "edit", edits());
  write(to / "job_options", options());
  write(to / "polygon", {"0 0\n10 0\n10 10\n0 10\n\n2 2\n4 2\n4 4\n",
                         R"({"type":"Polygon","coordinates":[[[0,0],[4,0],[4,4],[0,0]]]})"});
  write(to / "report_page",
        {R"({"program":"tessera","mesh":{"faces":12},"stages":[{"name":"a","result":{"wall_s":1}}]})"});
  return 0;
}

// The stage that stream/README.md adds: its code block is included as it stands there (tests/CMakeLists.txt).
#include <catch2/catch.hpp>

#include <algorithm>
#include <array>
#include <memory>

#include "octree/error.h"
#include "octree/vector.h"
#include "stream/files/durable_file.h"
#include "stream/files/json.h"
#include "stream/import/import_stages.h"
#include "stream/runtime/numbers.h"
#include "stream/runtime/option_table.h"
#include "stream/runtime/stage_runner.h"
#include "tests/helpers/shell.h"
#include "tests/helpers/temp_folder.h"

using namespace tessera;
using namespace tessera::test;

namespace {
#include TESSERA_README_STAGE

namespace readme_stage_test {}  // namespace readme_stage_test

}  // namespace

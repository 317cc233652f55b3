#include <fmt/format.h>

#include <memory>

#include "octree/error.h"
#include "stream/queue/submission.h"
#include "stream/runtime/work_dir.h"
#include "tools/commands.h"
#include "tools/frame/cli.h"

namespace tessera {

cli::Command cancel_command() {
  auto path = std::make_shared<std::filesystem::path>();
  OptionTable t;
  t.add("workdir", path.get(), "work directory of the job, OUT.tessera").positional();
  return {"cancel",
          "Takes a submitted job out of the queue. What is committed stays; submit goes on from there.", t,
          [path] {
            if (path->empty()) throw UsageError("give the work directory, OUT.tessera");
            const WorkDir work = WorkDir::open_existing(*path, false);
            const std::size_t ended = cancel_submission(work.path());
            fmt::print("{}: {} jobs taken out of the queue; what is committed stays\n", work.path().string(),
                       ended);
          }};
}

}  // namespace tessera

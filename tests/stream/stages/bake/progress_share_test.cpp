#include "stream/stages/bake/progress_share.h"

#include <catch2/catch.hpp>

#include "octree/error.h"
#include "tests/helpers/serial_job.h"
#include "tests/helpers/temp_folder.h"

namespace tessera::progress_share_test {

TEST_CASE("progress share: is exact at its end, whatever the steps, and never beyond", "[unit]") {
  const test::TempFolder folder;
  for (const std::uint64_t told : {0, 7, 100, 1000}) {  // of 100 that come
    INFO(told << " steps were told");
    test::SerialContext outer(folder.path());
    ProgressShare share(outer, told, 30);
    std::uint64_t before = 0;
    for (int step = 0; step < 100; ++step) {
      share.advance(1);
      CHECK(outer.advanced >= before);
      CHECK(outer.advanced <= 30);
      before = outer.advanced;
    }
    CHECK(outer.advanced == (told == 0 ? 0u : told == 1000 ? 3u : 30u));
    share.complete();
    share.complete();
    CHECK(outer.advanced == 30);
  }
}

TEST_CASE("progress share: everything else goes on to the context outside", "[unit]") {
  class Stopped : public test::SerialContext {
   public:
    using SerialContext::SerialContext;
    void check_stop() const override { throw StoppedError("asked to"); }
  };
  const test::TempFolder folder;
  Stopped outer(folder.path());
  ProgressShare share(outer, 10, 10);
  CHECK_THROWS_AS(share.check_stop(), StoppedError);
  CHECK(share.create("a/b") == folder.path() / "a/b");
  share.count_read(3);
  share.count_written(4);
  CHECK(outer.read == 3);
  CHECK(outer.written == 4);
  CHECK(outer.advanced == 0);
}

}  // namespace tessera::progress_share_test

// `tessera view`: what it refuses, the page of a mesh, and the local server. What the page shows: tools/viewer/test.
#include <catch2/catch.hpp>

#include <arpa/inet.h>
#include <fcntl.h>
#include <signal.h>
#include <sys/socket.h>
#include <sys/wait.h>
#include <unistd.h>
#include <zlib.h>

#include <chrono>
#include <cstring>

#include "stream/files/json.h"
#include "stream/page/view_page.h"
#include "tests/helpers/command.h"
#include "tests/helpers/shell.h"
#include "tests/helpers/temp_folder.h"

namespace view_test {

using namespace tessera;
using namespace tessera::test;
namespace fs = std::filesystem;

namespace {

constexpr const char* kCoin =
    "ply\nformat ascii 1.0\ncomment tessera_shift 500000 5400000 0\nelement vertex 4\nproperty float "
    "x\nproperty float y\n"
    "property float z\nproperty uchar red\nproperty uchar green\nproperty uchar blue\nelement face 2\n"
    "property list uchar int vertex_indices\nproperty uchar synthetic\nend_header\n"
    "0 0 0 255 0 0\n1 0 0 0 255 0\n0 1 0.125 0 0 255\n1 1 0.25 9 9 9\n3 0 1 2 0\n3 2 1 3 1\n";

/// A bundle whose page is its frame alone, so that no test needs Node.
fs::path bundle(const TempFolder& folder) {
  spill(folder / "viewer/viewer.html",
        "<!DOCTYPE html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n<meta name=\"generator\" "
        "content=\"tessera "
        "view\">\n</head><body>\n<!--tessera:data-->\n<script>0</script></body></html>\n");
  fs::copy_file(TESSERA_SOURCE_DIR "/tools/viewer/serve.py", folder / "viewer/serve.py",
                fs::copy_options::overwrite_existing);
  return folder / "viewer";
}

fs::path site(const TempFolder& folder) {
  spill(folder / "site/tileset.json",
        R"({"asset": {"version": "1.1"}, "geometricError": 1, "root": {"refine": "ADD"}})");
  spill(folder / "site/tiles/a b.glb", "glTF of a");
  spill(folder / "site/notes.txt", "mine");
  spill(folder / "secret.json", "secret");
  fs::create_symlink(folder / "secret.json", folder / "site/link.json");
  return folder / "site";
}

std::vector<std::string> view(const TempFolder& folder, std::vector<std::string> words) {
  words.insert(words.begin(), "view");
  words.insert(words.end(), {"--viewer", bundle(folder).string()});
  return words;
}

CommandResult refused(int code, const std::vector<std::string>& words) {
  const CommandResult r = tessera_command(words);
  INFO(r.errors);
  CHECK(r.code == code);
  CHECK(std::count(r.errors.begin(), r.errors.end(), '\n') == 1);
  return r;
}

/// A block of the page as its numbers.
template <class T>
std::vector<T> block(const std::string& page, const std::string& id) {
  const std::string begin = "id=\"" + id + "\">";
  const std::size_t at = page.find(begin);
  if (at == std::string::npos) return {};
  std::string packed;
  unsigned bits = 0, value = 0;
  for (std::size_t i = at + begin.size(); page[i] != '<' && page[i] != '='; ++i) {
    static const std::string kDigits = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    value = value << 6 | static_cast<unsigned>(kDigits.find(page[i]));
    if ((bits += 6) < 8) continue;
    bits -= 8;
    packed.push_back(static_cast<char>(value >> bits & 255));
  }
  std::vector<T> out(std::size_t{1} << 23);
  uLongf bytes = out.size() * sizeof(T);
  REQUIRE(uncompress(reinterpret_cast<Bytef*>(out.data()), &bytes,
                     reinterpret_cast<const Bytef*>(packed.data()), packed.size()) == Z_OK);
  out.resize(bytes / sizeof(T));
  return out;
}

Json settings_of(const std::string& page) {
  const std::string begin = "id=\"tessera-view\">";
  const std::size_t at = page.find(begin) + begin.size();
  return parse_json(page.substr(at, page.find("</script>", at) - at));
}

/// A running `tessera view`, which prints where it serves.
class Served {
 public:
  explicit Served(std::vector<std::string> words) {
    words.insert(words.begin(), TESSERA_BINARY);
    int line[2];
    REQUIRE(::pipe(line) == 0);
    child_ = ::fork();
    if (child_ == 0) {
      std::vector<char*> argv;
      for (std::string& w : words) argv.push_back(w.data());
      argv.push_back(nullptr);
      ::dup2(line[1], 1);
      ::dup2(::open("/dev/null", O_WRONLY), 2);
      ::execv(argv[0], argv.data());
      ::_exit(127);
    }
    ::close(line[1]);
    for (char c = 0; ::read(line[0], &c, 1) == 1 && c != '\n';) url_ += c;
    ::close(line[0]);
  }
  ~Served() {
    if (child_ > 0) stop(SIGKILL);
  }
  Served(const Served&) = delete;
  Served& operator=(const Served&) = delete;

  const std::string& url() const { return url_; }
  int port() const { return url_.size() > 17 ? std::stoi(url_.substr(17)) : 0; }

  /// The whole answer to a request as it is typed.
  std::string request(const std::string& path, std::string host = {},
                      const std::string& method = "GET") const {
    const int s = ::socket(AF_INET, SOCK_STREAM, 0);
    sockaddr_in at{};
    at.sin_family = AF_INET;
    at.sin_port = htons(static_cast<std::uint16_t>(port()));
    at.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    REQUIRE(::connect(s, reinterpret_cast<const sockaddr*>(&at), sizeof at) == 0);
    if (host.empty()) host = "127.0.0.1:" + std::to_string(port());
    const std::string requested =
        method + " " + path + " HTTP/1.1\r\nHost: " + host + "\r\nConnection: close\r\n\r\n";
    REQUIRE(::send(s, requested.data(), requested.size(), 0) == static_cast<ssize_t>(requested.size()));
    std::string answer;
    char part[4096];
    for (ssize_t n = 0; (n = ::recv(s, part, sizeof part, 0)) > 0;)
      answer.append(part, static_cast<std::size_t>(n));
    ::close(s);
    return answer;
  }
  int code(const std::string& path, const std::string& host = {}, const std::string& method = "GET") const {
    const std::string answer = request(path, host, method);
    return answer.size() > 12 ? std::stoi(answer.substr(9, 3)) : 0;
  }
  /// \returns the exit code, or 128 + signal
  int stop(int signal) {
    int status = 0;
    ::kill(child_, signal);
    ::waitpid(child_, &status, 0);
    child_ = -1;
    return WIFEXITED(status) ? WEXITSTATUS(status) : 128 + WTERMSIG(status);
  }

 private:
  pid_t child_ = -1;
  std::string url_;
};

}  // namespace

TEST_CASE("view: what cannot be viewed is refused in a sentence", "[fault]") {
  const TempFolder folder;
  const std::string mesh = folder.write("coin.ply", kCoin).string(), page = (folder / "page.html").string();
  const CommandResult missing =
      refused(2, {"view", mesh, "-o", page, "--viewer", (folder / "none").string()});
  CHECK(missing.errors.find("tools/viewer/build") != std::string::npos);
  refused(2, view(folder, {}));
  refused(2, view(folder, {mesh, mesh}));
  refused(3, view(folder, {(folder / "gone.ply").string()}));
  refused(3, view(folder, {folder.write("bad.ply", "ply\nnonsense\n").string(), "-o", page}));
  refused(3, view(folder, {folder.write("far.off", "OFF 3 1 0\n0 0 0\n1 0 nan\n0 1 0\n3 0 1 2\n").string(),
                           "-o", page}));
  refused(5,
          view(folder, {folder.write("none.off", "OFF 3 0 0\n0 0 0\n1 0 0\n0 1 0\n").string(), "-o", page}));
  refused(2, view(folder, {mesh, "-o", (folder / "page.png").string()}));
  refused(2, view(folder, {mesh, "-o", page, "--signed"}));
  refused(3, view(folder, {mesh, "-o", page, "--deviation", (folder / "gone.ply").string()}));
  refused(4, view(folder, {mesh, "-o", page, "--memory", "1M"}));
  refused(2, view(folder, {site(folder).string(), "-o", page}));
  refused(3, view(folder, {folder.write("other.json", R"({"asset": 1})").string()}));
  fs::create_directory(folder / "empty");
  refused(3, view(folder, {(folder / "empty").string()}));
  CHECK_FALSE(fs::exists(page));

  std::string large =
      "ply\nformat binary_little_endian 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty "
      "float z\nelement face 2000001\nproperty list uchar int vertex_indices\nend_header\n";
  large.resize(large.size() + 36 + std::size_t{2000001} * 13, '\0');
  const CommandResult many =
      refused(2, view(folder, {folder.write("large.ply", large).string(), "-o", page}));
  CHECK(many.errors.find("2,000,001 faces") != std::string::npos);
  CHECK(many.errors.find("tessera tiles") != std::string::npos);
}

TEST_CASE("view: the page holds the mesh, its colours, its marks and where it lies", "[pipeline]") {
  const TempFolder folder;
  const fs::path page = folder / "page.html";
  REQUIRE(tessera_command(
              view(folder, {folder.write("<coin>.ply", kCoin).string(), "-o", page.string(), "--up", "y"}))
              .code == 0);
  const std::string text = file_bytes(page);
  CHECK(text.ends_with("\n<script>0</script></body></html>\n"));
  const Json values = settings_of(text);
  CHECK(values.at("kind") == "mesh");
  CHECK(values.at("name") == "<coin>.ply");
  CHECK(values.at("up") == "y");
  CHECK(text.find("<coin>") == std::string::npos);
  const auto origin = values.at("origin").get<std::array<double, 3>>();
  const std::vector<float> p = block<float>(text, "mesh-positions");
  REQUIRE(p.size() == 12);
  CHECK(static_cast<double>(p[9]) + origin[0] == 500001.0);
  CHECK(static_cast<double>(p[10]) + origin[1] == 5400001.0);
  CHECK(static_cast<double>(p[11]) + origin[2] == 0.25);
  CHECK(block<std::int32_t>(text, "mesh-faces") == std::vector<std::int32_t>{0, 1, 1, 0, -1, 2});
  CHECK(block<std::uint8_t>(text, "mesh-colours") ==
        std::vector<std::uint8_t>{255, 0, 0, 0, 255, 0, 0, 0, 255, 9, 9, 9});
  CHECK(block<std::uint8_t>(text, "mesh-synthetic") == std::vector<std::uint8_t>{0, 1});
  CHECK(is_view(page));
}

TEST_CASE("view: coordinates of maps keep what single precision around their own origin can", "[property]") {
  const TempFolder folder;
  const fs::path page = folder / "page.html";
  REQUIRE(tessera_command(
              view(folder, {folder
                                .write("far.off",
                                       "OFF 3 1 0\n4512345.678 5412345.671 312.25\n4512346.789 "
                                       "5412345.672 313.5\n4512345.111 5412399.673 311.125\n3 0 1 2\n")
                                .string(),
                            "-o", page.string()}))
              .code == 0);
  const std::string text = file_bytes(page);
  const auto origin = settings_of(text).at("origin").get<std::array<double, 3>>();
  const std::vector<float> p = block<float>(text, "mesh-positions");
  REQUIRE(p.size() == 9);
  const std::vector<double> truth = {4512345.678, 5412345.671, 312.25,      4512346.789, 5412345.672,
                                     313.5,       4512345.111, 5412399.673, 311.125};
  for (std::size_t i = 0; i < 9; ++i)
    CHECK(std::abs(static_cast<double>(p[i]) + origin[i % 3] - truth[i]) < 4e-6);
}

TEST_CASE("view: distances to a reference, with sign and scale", "[pipeline]") {
  const TempFolder folder;
  const fs::path page = folder / "page.html";
  const std::string plane =
      folder.write("plane.off", "OFF 4 2 0\n0 0 0\n8 0 0\n0 8 0\n8 8 0\n3 0 1 2\n3 2 1 3\n").string();
  const std::string curved =
      folder.write("bent.off", "OFF 4 2 0\n1 1 0.25\n7 1 -0.5\n1 7 0\n7 7 6\n3 0 1 2\n3 2 1 3\n").string();
  REQUIRE(tessera_command(view(folder, {curved, "-o", page.string(), "--deviation", plane, "--signed",
                                        "--tolerance", "0.4"}))
              .code == 0);
  const std::string text = file_bytes(page);
  const std::vector<float> d = block<float>(text, "mesh-deviation"), p = block<float>(text, "mesh-positions");
  REQUIRE(d.size() * 3 == p.size());
  CHECK(d.size() > 6);  // faces are cut, so that what their corners hide shows
  const auto origin = settings_of(text).at("origin").get<std::array<double, 3>>();
  std::size_t behind = 0, beyond = 0;
  for (std::size_t i = 0; i < d.size(); ++i) {
    const double z = static_cast<double>(p[3 * i + 2]) + origin[2];
    behind += d[i] < 0.0f;
    beyond += std::isinf(d[i]);
    if (std::isinf(d[i]))
      CHECK(z > 0.6 - 1e-6);
    else
      CHECK(static_cast<double>(d[i]) == Approx(z).margin(1e-6));
  }
  CHECK(behind > 100);
  CHECK(beyond > 100);
  CHECK(settings_of(text).at("faces") == 2);
  CHECK(settings_of(text).at("deviation").at("high") == 0.4);
  CHECK(settings_of(text).at("deviation").at("signed") == true);
}

TEST_CASE("view: what deviate wrote is coloured by its deviations, a mesh and points", "[pipeline]") {
  const TempFolder folder;
  const fs::path page = folder / "page.html";
  const std::string plane =
      folder.write("plane.off", "OFF 4 2 0\n0 0 0\n8 0 0\n0 8 0\n8 8 0\n3 0 1 2\n3 2 1 3\n").string();
  const std::string curved =
      folder.write("bent.off", "OFF 4 2 0\n1 1 0.25\n7 1 -0.5\n1 7 0\n7 7 6\n3 0 1 2\n3 2 1 3\n").string();
  const std::string mesh = (folder / "mesh.ply").string(), cloud = (folder / "cloud.ply").string();
  REQUIRE(tessera_command({"deviate", curved, "--to", plane, "--max-distance", "2", "-o", mesh}).code == 0);
  REQUIRE(tessera_command(view(folder, {mesh, "-o", page.string(), "--tolerance", "0.75"})).code == 0);
  std::string text = file_bytes(page);
  const std::vector<float> carried = block<float>(text, "mesh-deviation");
  REQUIRE(carried.size() == 4);
  CHECK(carried[0] == 0.25f);
  CHECK(carried[1] == -0.5f);
  CHECK(std::isnan(carried[3]));
  CHECK(settings_of(text).at("deviation") == Json({{"high", 0.75}, {"signed", true}}));
  CHECK(settings_of(text).at("faces") == 2);
  // Another reference has its own say.
  REQUIRE(tessera_command(view(folder, {mesh, "-o", page.string(), "--deviation", plane})).code == 0);
  CHECK(settings_of(file_bytes(page)).at("deviation").at("reference") == "plane.off");

  std::string points;
  for (int i = 0; i < 4000; ++i)
    points += std::to_string(0.002 * i) + " " + std::to_string(0.001 * i) + " " +
              (i % 100 == 0 ? "5" : "0.5") + "\n";
  const std::string scan = folder.write("scan.xyz", points).string();
  REQUIRE(tessera_command({"deviate", scan, "--to", plane, "--max-distance", "2", "-o", cloud}).code == 0);
  REQUIRE(tessera_command(view(folder, {cloud, "-o", page.string(), "--memory", "256M"})).code == 0);
  text = file_bytes(page);
  const Json values = settings_of(text);
  CHECK(values.at("points") == 3960);  // those 5 above it have none
  const auto spots = values.at("spots").get<std::size_t>();
  CHECK(spots > 500);
  CHECK(spots <= 3960);
  CHECK(values.at("faces") == 8 * spots);
  const auto high = values.at("deviation").at("high").get<double>();
  CHECK(high == Approx(0.5).epsilon(0.01));
  CHECK(high >= 0.5);
  CHECK(block<float>(text, "mesh-positions").size() == 18 * spots);
  const std::vector<float> means = block<float>(text, "mesh-deviation");
  REQUIRE(means.size() == 6 * spots);
  for (const float m : means) CHECK(m == Approx(0.5f).epsilon(1e-4));

  // Points without deviations are no mesh, and a file that ends early is told.
  refused(2, view(folder, {plane, "-o", page.string(), "--tolerance", "1"}));
  refused(3, view(folder, {folder.write("cut.ply", file_bytes(cloud).substr(0, 2000)).string(), "-o",
                           (folder / "cut.html").string()}));
  CHECK_FALSE(fs::exists(folder / "cut.html"));
}

TEST_CASE("view: doubts of a reconstruction go with the vertices next to them", "[pipeline]") {
  const TempFolder folder;
  const fs::path page = folder / "page.html";
  const std::string mesh = folder.write("coin.ply", kCoin).string();
  const std::string head =
      "ply\nformat ascii 1.0\nelement vertex 2\nproperty double x\nproperty double y\nproperty double z\n"
      "property uchar red\nproperty uchar green\nproperty uchar blue\nend_header\n";
  const std::string doubts =
      folder.write("d.ply", head + "500000.1 5400000 0 176 176 176\n500000.9 5400000.4 0 224 48 32\n")
          .string();
  REQUIRE(tessera_command(view(folder, {mesh, "-o", page.string(), "--uncertain", doubts})).code == 0);
  CHECK(block<std::uint8_t>(file_bytes(page), "mesh-uncertain") == std::vector<std::uint8_t>{0, 1, 0, 1});
  const std::string other = folder.write("o.ply", head + "0 0 0 1 2 3\n1 0 0 1 2 3\n").string();
  refused(3, view(folder, {mesh, "-o", page.string(), "--uncertain", other}));
  refused(2, view(folder, {mesh, "-o", page.string(), "--uncertain", doubts, "--deviation", mesh}));
  refused(2, view(folder, {site(folder).string(), "--uncertain", doubts}));
}

TEST_CASE("view: writes over no input and no file of the user's, its own page it replaces", "[fault]") {
  const TempFolder folder;
  const std::string mesh = folder.write("coin.ply", kCoin).string();
  const fs::path page = folder / "page.html";
  spill(page, "mine");
  refused(2, view(folder, {mesh, "-o", page.string()}));
  CHECK(file_bytes(page) == "mine");
  REQUIRE(tessera_command(view(folder, {mesh, "-o", page.string(), "--force"})).code == 0);
  REQUIRE(tessera_command(view(folder, {mesh, "-o", page.string()})).code == 0);
  CHECK(is_view(page));
  fs::create_hard_link(mesh, folder / "hard.html");
  refused(2, view(folder, {mesh, "-o", (folder / "hard.html").string(), "--force"}));
  CHECK(file_bytes(mesh) == kCoin);
}

TEST_CASE("view: a mesh goes through a small cap", "[memory]") {
  const TempFolder folder;
  constexpr std::uint32_t kSide = 500;
  std::string mesh =
      "ply\nformat binary_little_endian 1.0\nelement vertex 250000\nproperty float x\nproperty float "
      "y\nproperty "
      "float z\nelement face 498002\nproperty list uchar int vertex_indices\nend_header\n";
  const auto put = [&](const void* data, std::size_t bytes) {
    mesh.append(static_cast<const char*>(data), bytes);
  };
  for (std::uint32_t i = 0; i < kSide * kSide; ++i) {
    const std::array<float, 3> p = {static_cast<float>(i % kSide), static_cast<float>(i / kSide), 0.5f};
    put(p.data(), sizeof p);
  }
  for (std::uint32_t j = 0; j + 1 < kSide; ++j)
    for (std::uint32_t i = 0; i + 1 < kSide; ++i) {
      const std::uint32_t a = j * kSide + i;
      for (const auto& f : {std::array{a, a + 1, a + kSide}, std::array{a + 1, a + kSide + 1, a + kSide}}) {
        mesh += '\3';
        put(f.data(), sizeof f);
      }
    }
  const fs::path page = folder / "page.html";
  const CommandResult r = tessera_command(
      view(folder, {folder.write("plane.ply", mesh).string(), "-o", page.string(), "--memory", "40M"}));
  INFO(r.errors);
  REQUIRE(r.code == 0);
  CHECK(r.peak_bytes < std::uint64_t{40} << 20);
  CHECK(fs::file_size(page) < mesh.size() / 3);  // packed
}

TEST_CASE("view: the server gives page and tiles to this machine, and nothing else", "[pipeline]") {
  const TempFolder folder;
  Served served(view(folder, {site(folder).string(), "--temp", folder.path().string()}));
  REQUIRE(served.url().starts_with("http://127.0.0.1:"));
  const std::string page = served.request("/");
  CHECK(page.find("200 OK") != std::string::npos);
  CHECK(page.find("\"url\":\"site/tileset.json\"") != std::string::npos);
  CHECK(served.request("/site/tiles/a%20b.glb?v=1").ends_with("\r\n\r\nglTF of a"));
  CHECK(served.request("/site/tileset.json", "localhost:" + std::to_string(served.port()))
            .find("application/json") != std::string::npos);
  CHECK(served.request("/", {}, "HEAD").ends_with("\r\n\r\n"));
  for (const char* path :
       {"/site/../secret.json", "/site/%2e%2e/secret.json", "/site/..%2fsecret.json",
        "/site/%2e%2e%2fsecret.json", "/../secret.json", "/site//../secret.json", "/site/link.json",
        "/secret.json", "/site/notes.txt", "/site/", "/site/gone.glb", "/site/tiles", "/site/tiles/a%00b.glb",
        "//etc/passwd", "/site//etc/hostname.json"}) {
    CAPTURE(path);
    CHECK(served.code(path) == 404);
    CHECK(served.request(path).find("secret") == std::string::npos);
  }
  CHECK(served.code("/", "evil.example:" + std::to_string(served.port())) == 403);
  CHECK(served.code("/site/tileset.json", "evil.example") == 403);
  CHECK(served.code("/", {}, "POST") == 501);
  // It left nothing of its own: the page has no name any more.
  for (const auto& entry : fs::directory_iterator(folder.path()))
    CHECK(entry.path().filename().string().rfind("tessera-", 0) != 0);

  // An open connection that says nothing does not hold it.
  const auto requested = std::chrono::steady_clock::now();
  CHECK(served.stop(SIGTERM) == 0);
  CHECK(std::chrono::steady_clock::now() - requested < std::chrono::seconds(1));
}

TEST_CASE("view: Ctrl-C ends the server, a port may be chosen, a taken one is told", "[pipeline]") {
  const TempFolder folder;
  const std::string mesh = folder.write("coin.ply", kCoin).string();
  Served first(view(folder, {mesh}));
  REQUIRE(first.port() > 0);
  CHECK(first.request("/").find("mesh-positions") != std::string::npos);
  CHECK(first.code("/site/tileset.json") == 404);
  refused(2, view(folder, {mesh, "--port", std::to_string(first.port())}));
  CHECK(first.stop(SIGINT) == 0);
  Served second(view(folder, {mesh, "--port", std::to_string(first.port())}));
  CHECK(second.port() == first.port());
  CHECK(second.stop(SIGTERM) == 0);
}

}  // namespace view_test

#include "stream/formats/points/crs.h"

#include <algorithm>
#include <array>
#include <charconv>
#include <cstdint>
#include <cstring>
#include <functional>
#include <optional>

#include "stream/formats/points/projection.h"
#include "stream/formats/scalar.h"

namespace tessera {
namespace {

// Of the public header: where its records lie.
constexpr std::uint64_t kGlobalEncodingAt = 6, kMinorVersion = 25, kPointFormatAt = 104, kHeaderSizeAt = 94,
                        kRecordCountAt = 100, kFirstExtended = 235, kExtendedCount = 243,
                        kHeaderBytes14 = 375;
constexpr std::uint64_t kRecordHeader = 54, kExtendedHeader = 60;
constexpr std::uint64_t kMaxRecords = 4096;                 // looked at; files have a handful
constexpr std::uint64_t kMaxText = std::uint64_t{1} << 20;  // of one record: WKT takes some hundred bytes

constexpr int kWktRecord = 2112, kKeyRecord = 34735, kKeyTextRecord = 34737;
constexpr int kModelKey = 1024, kCitationKey = 1026, kGeographicKey = 2048, kGeographicCitationKey = 2049,
              kProjectedKey = 3072, kProjectedCitationKey = 3073, kVerticalKey = 4096,
              kVerticalUnitsKey = 4099;
constexpr int kGeographicModel = 2, kUserDefined = 32767;
constexpr unsigned kWktBit = 16;  ///< of the global encoding
constexpr int kFirstWktFormat = 6, kPointFormatMask = 0x3f;
constexpr double kFoot = 0.3048, kSurveyFoot = 1200.0 / 3937.0;

struct LasRecord {
  int id = 0;
  std::string bytes;
};

template <class T>
T number_at(const ReadFile& file, std::uint64_t offset) {
  std::array<char, sizeof(T)> bytes{};
  file.read_at(offset, bytes.data(), bytes.size());
  return load_scalar<T>(bytes.data());
}

/// Reads the records of the projection from `at` on.
void read_records(const ReadFile& file, std::uint64_t at, std::uint64_t count, bool extended,
                  std::vector<LasRecord>& out, std::vector<std::string>& warnings) {
  const std::uint64_t head = extended ? kExtendedHeader : kRecordHeader;
  for (std::uint64_t i = 0; i < std::min(count, kMaxRecords); ++i) {
    if (at > file.size() || file.size() - at < head) {
      warnings.push_back("record " + std::to_string(i + 1) + " of " + std::to_string(count) +
                         " beside the points would start at byte " + std::to_string(at) +
                         ", beyond the end of the file; records from there on are ignored");
      return;
    }
    std::array<char, kExtendedHeader> bytes{};
    file.read_at(at, bytes.data(), head);
    const std::uint64_t length = extended ? load_scalar<std::uint64_t>(bytes.data() + 20)
                                          : load_scalar<std::uint16_t>(bytes.data() + 20);
    at += head;
    if (length > file.size() - at) {
      warnings.push_back("record " + std::to_string(i + 1) + " of " + std::to_string(count) +
                         " beside the points claims " + std::to_string(length) +
                         " bytes, more than the file has; it is ignored");
      return;
    }
    const int id = load_scalar<std::uint16_t>(bytes.data() + 18);
    const bool wanted = id == kWktRecord || id == kKeyRecord || id == kKeyTextRecord;
    if (wanted && std::strncmp(bytes.data() + 2, "LASF_Projection", 16) == 0 && length <= kMaxText) {
      out.push_back({id, std::string(length, '\0')});
      file.read_at(at, out.back().bytes.data(), length);
    }
    at += length;
  }
}

/// Without white space outside of quotes: what remains is the system.
std::string bare(const std::string& wkt) {
  std::string text;
  bool quoted = false;
  for (const char c : wkt) {
    if (c == '"') quoted = !quoted;
    if (quoted || !(c == ' ' || (c >= '\t' && c <= '\r'))) text += c;
  }
  return text;
}

/// The code of AUTHORITY["EPSG","1234"] or ID["EPSG",1234] that ends this node, which begins at `begin` and whose last
/// bracket is text[end]; 0 without one.
int code_at_end(const std::string& text, std::size_t begin, std::size_t end) {
  for (const std::string mark : {"AUTHORITY[\"EPSG\",", "ID[\"EPSG\","}) {
    const std::size_t at = text.rfind(mark, end);
    if (at == std::string::npos || at <= begin) continue;
    const std::size_t digits = text.find_first_of("0123456789", at + mark.size());
    const std::size_t close = text.find(']', at);
    if (close == std::string::npos || close + 1 != end || digits > close) continue;
    int code = 0;
    std::from_chars(text.data() + digits, text.data() + close, code);
    return code;
  }
  return 0;
}

/// The end of the node that begins at `begin`: its closing bracket; npos if there is none.
std::size_t node_end(const std::string& text, std::size_t begin) {
  int depth = 0;
  bool quoted = false;
  for (std::size_t i = begin; i < text.size(); ++i) {
    if (text[i] == '"') quoted = !quoted;
    if (quoted) continue;
    if (text[i] == '[') ++depth;
    if (text[i] == ']' && --depth <= 0) return i;
  }
  return std::string::npos;
}

/// Code of the first node of one of these kinds.
int code_of_node(const std::string& text, std::initializer_list<const char*> kinds) {
  for (const char* kind : kinds) {
    const std::size_t at = text.find(std::string(kind) + "[");
    if (at == std::string::npos) continue;
    const std::size_t end = node_end(text, at);
    if (end != std::string::npos) return code_at_end(text, at, end);
  }
  return 0;
}

bool has_node(const std::string& text, std::initializer_list<const char*> kinds) {
  return std::any_of(kinds.begin(), kinds.end(), [&](const char* kind) {
    return text.find(std::string(kind) + "[") != std::string::npos;
  });
}

/// Metres of the unit of the vertical system in a text; 0 without.
double height_unit_of(const std::string& text) {
  for (const char* kind : {"VERT_CS[", "VERTCRS["}) {
    const std::size_t at = text.find(kind);
    if (at == std::string::npos) continue;
    const std::string node = text.substr(at, node_end(text, at) - at);
    std::size_t unit = node.find("LENGTHUNIT[\"");
    if (unit == std::string::npos) unit = node.find("UNIT[\"");
    const std::size_t comma = unit == std::string::npos ? unit : node.find("\",", unit);
    double metres = 0.0;
    if (comma == std::string::npos) continue;
    std::from_chars(node.data() + comma + 2, node.data() + node.size(), metres);
    return metres > 0.0 && metres < 1e3 ? metres : 0.0;
  }
  return 0.0;
}

Crs crs_of_keys(const std::string& directory, const std::string& texts) {
  Crs crs;
  const std::size_t words = directory.size() / 2;
  const auto word = [&](std::size_t i) -> int {
    return load_scalar<std::uint16_t>(directory.data() + 2 * i);
  };
  int model = 0, geographic = 0, projected = 0;
  std::string citation;
  // The first entry is the header: version, revision, minor revision, number of keys.
  for (std::size_t i = 4; i + 4 <= words && i / 4 <= static_cast<std::size_t>(word(3)); i += 4) {
    const int key = word(i), place = word(i + 1), value = word(i + 3);
    const auto count = static_cast<std::size_t>(word(i + 2)), first = static_cast<std::size_t>(value);
    if (place == 0) {
      if (key == kModelKey) model = value;
      if (key == kGeographicKey) geographic = value;
      if (key == kProjectedKey) projected = value;
      if (key == kVerticalKey && value != kUserDefined) crs.vertical = value;
      if (key == kVerticalUnitsKey)
        crs.height_unit = value == 9001 ? 1.0 : value == 9002 ? kFoot : value == 9003 ? kSurveyFoot : 0.0;
    } else if (place == kKeyTextRecord && first < texts.size() &&
               (key == kCitationKey || key == kProjectedCitationKey ||
                (key == kGeographicCitationKey && citation.empty()))) {
      citation = texts.substr(first, count);
      citation.resize(std::min(citation.find('|'), citation.size()));
    }
  }
  crs.geographic = model == kGeographicModel || (model == 0 && projected == 0 && geographic != 0);
  const int code = crs.geographic ? geographic : projected;
  if (code != 0 && code != kUserDefined) crs.horizontal = code;
  if (crs.horizontal != 0) crs.name = "EPSG:" + std::to_string(crs.horizontal);
  if (crs.vertical != 0)
    crs.name += (crs.name.empty() ? "" : " + ") + ("EPSG:" + std::to_string(crs.vertical));
  if (crs.horizontal == 0 && !citation.empty())
    crs.name = citation + (crs.name.empty() ? "" : " + " + crs.name);
  if (crs.name.empty() && crs.geographic) crs.name = "longitude and latitude";
  return crs;
}

}  // namespace

Crs longitude_and_latitude() {
  Crs crs;
  crs.name = "longitude and latitude";
  crs.horizontal = 4326;
  crs.geographic = true;
  return crs;
}

bool may_be_same(const Crs& a, const Crs& b) {
  if (!a.known() || !b.known()) return true;
  if (a.vertical != 0 && b.vertical != 0 && a.vertical != b.vertical) return false;
  if (a.horizontal != 0 && b.horizontal != 0) return a.horizontal == b.horizontal;
  return a.name == b.name || (!a.wkt.empty() && bare(a.wkt) == bare(b.wkt));
}

Crs crs_of_wkt(const std::string& wkt) {
  Crs crs;
  crs.wkt = wkt.substr(0, wkt.find('\0'));
  const std::string text = bare(crs.wkt);
  const std::size_t open = text.find('"');
  const std::size_t close = open == std::string::npos ? open : text.find('"', open + 1);
  if (close == std::string::npos) return {};  // no text of a system
  crs.name = text.substr(open + 1, close - open - 1);
  // A compound holds both; what stands inside a projected system is only what it is based on.
  crs.horizontal = code_of_node(text, {"PROJCS", "PROJCRS", "GEOGCS", "GEOGCRS", "GEODCRS"});
  crs.vertical = code_of_node(text, {"VERT_CS", "VERTCRS"});
  crs.geographic = !has_node(text, {"PROJCS", "PROJCRS", "PROJECTEDCRS"}) &&
                   has_node(text, {"GEOGCS", "GEOGCRS", "GEOGRAPHICCRS", "GEODCRS"}) &&
                   text.find("CS[Cartesian") == std::string::npos;
  crs.height_unit = height_unit_of(text);
  return crs;
}

Crs las_crs(const ReadFile& file, std::vector<std::string>& warnings) {
  std::vector<LasRecord> records;
  read_records(file, number_at<std::uint16_t>(file, kHeaderSizeAt),
               number_at<std::uint32_t>(file, kRecordCountAt), false, records, warnings);
  if (number_at<std::uint8_t>(file, kMinorVersion) >= 4 && file.size() >= kHeaderBytes14)
    if (const auto count = number_at<std::uint32_t>(file, kExtendedCount); count > 0)
      read_records(file, number_at<std::uint64_t>(file, kFirstExtended), count, true, records, warnings);
  std::string keys, texts;
  Crs of_text;
  for (const LasRecord& record : records) {
    if (record.id == kWktRecord && !of_text.known()) of_text = crs_of_wkt(record.bytes);
    if (record.id == kKeyRecord) keys = record.bytes;
    if (record.id == kKeyTextRecord) texts = record.bytes;
  }
  Crs of_keys = crs_of_keys(keys, texts);
  if (!of_text.known()) return of_keys;
  const bool text_alone =
      (number_at<std::uint16_t>(file, kGlobalEncodingAt) & kWktBit) != 0 ||
      (number_at<std::uint8_t>(file, kPointFormatAt) & kPointFormatMask) >= kFirstWktFormat;
  if (text_alone || !of_keys.known()) return of_text;
  bool differ =
      of_keys.horizontal != 0 && of_text.horizontal != 0 && of_text.horizontal != of_keys.horizontal;
  if (of_keys.horizontal != 0 && of_text.horizontal == 0) {
    const std::optional<bool> same = same_projection(of_text, of_keys);
    differ = same.has_value() && !*same;
    if (!same) of_keys.horizontal = 0;
  }
  if (differ) {
    warnings.push_back(
        "WKT and GeoTIFF keys name different systems, " + of_text.name + " and " + of_keys.name +
        ": the keys count, as the header does not say that the WKT does (--crs overrules both)");
    return of_keys;
  }
  if (of_text.horizontal == 0) of_text.horizontal = of_keys.horizontal;
  if (of_text.vertical == 0) of_text.vertical = of_keys.vertical;
  if (of_text.height_unit == 0.0) of_text.height_unit = of_keys.height_unit;
  return of_text;
}

}  // namespace tessera

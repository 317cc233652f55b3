/// \file e57_writer.h
/// Writes E57 files for tests: any fields in any width, packets cut where a test wants them, and the checksums renewed
/// over what a test has damaged.
#pragma once
#include <bit>
#include <cstdint>
#include <cstdio>
#include <cstring>
#include <stdexcept>
#include <string>
#include <vector>

namespace tessera::test {

/// One field of all records. What is stored of a scaled integer is its whole number, before scale and offset.
struct E57Values {
  std::string name;
  std::string type = "double";  ///< double, single, Integer, ScaledInteger
  std::vector<double> floats;
  std::vector<std::int64_t> integers;
  std::int64_t minimum = 0, maximum = 0;
  double scale = 1.0, offset = 0.0;
  std::string more;  ///< attributes
};

struct E57TestScan {
  std::vector<E57Values> fields;
  std::string xml;             ///< pose, limits and the like
  std::int64_t declared = -1;  ///< -1 = as many as there are
  std::size_t packets = 1;     ///< that the records are spread over
  bool skewed = false;         ///< the streams run apart: one is further than another at the end of a packet
};

inline std::string e57_pose(const std::string& w, const std::string& x, const std::string& y,
                            const std::string& z, const std::string& translation_x,
                            const std::string& translation_y, const std::string& translation_z) {
  const auto number = [](const char* name, const std::string& value) {
    return std::string("<") + name + " type=\"Float\">" + value + "</" + name + ">";
  };
  return "<pose type=\"Structure\"><rotation type=\"Structure\">" + number("w", w) + number("x", x) +
         number("y", y) + number("z", z) + "</rotation><translation type=\"Structure\">" +
         number("x", translation_x) + number("y", translation_y) + number("z", translation_z) +
         "</translation></pose>";
}

/// CRC-32C bit by bit, so that it owes nothing to the one that is tested.
inline std::uint32_t slow_crc32c(const char* bytes, std::size_t count) {
  std::uint32_t crc = ~0u;
  for (std::size_t i = 0; i < count; ++i) {
    crc ^= static_cast<unsigned char>(bytes[i]);
    for (int b = 0; b < 8; ++b) crc = crc >> 1 ^ (crc & 1 ? 0x82f63b78u : 0u);
  }
  return ~crc;
}

/// Fills the last page and renews every checksum.
inline std::string e57_sealed(std::string file) {
  file.resize((file.size() + 1023) / 1024 * 1024, '\0');
  for (std::size_t page = 0; page < file.size(); page += 1024) {
    const std::uint32_t crc = slow_crc32c(file.data() + page, 1020);
    for (std::size_t b = 0; b < 4; ++b) file[page + 1020 + b] = static_cast<char>(crc >> (24 - 8 * b));
  }
  return file;
}

/// Builds the logical bytes of a file, then the file.
class E57Builder {
 public:
  E57Builder() : bytes_(48, '\0') {}

  void add(const E57TestScan& scan) {
    align();
    const std::size_t section = bytes_.size();
    bytes_ += std::string(32, '\0');
    bytes_[section] = 1;
    put_at(section + 16, physical(bytes_.size()));
    packets(scan);
    put_at(section + 24, physical(bytes_.size()));
    bytes_ +=
        std::string("\0\0\x1f\0\1\0\0\0\0\0\0\0\0\0\0\0", 16) + std::string(16, '\0');  // an index packet
    put_at(section + 8, std::uint64_t{bytes_.size() - section});
    const std::size_t n = scan.fields.empty() ? 0 : count(scan.fields[0]);
    const std::int64_t declared = scan.declared < 0 ? static_cast<std::int64_t>(n) : scan.declared;
    scans_ += "<vectorChild type=\"Structure\">" + scan.xml +
              "<points type=\"CompressedVector\" fileOffset=\"" + std::to_string(physical(section)) +
              "\" recordCount=\"" + std::to_string(declared) + "\"><prototype type=\"Structure\">";
    for (const E57Values& f : scan.fields) scans_ += element(f);
    scans_ +=
        "</prototype><codecs type=\"Vector\" allowHeterogeneousChildren=\"1\"/></points></vectorChild>\n";
  }

  std::string file() const {
    return file(
        "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n<e57Root type=\"Structure\" "
        "xmlns=\"http://www.astm.org/COMMIT/E57/2010-e57-v1.0\">\n<data3D type=\"Vector\" "
        "allowHeterogeneousChildren=\"1\">\n" +
        scans_ + "</data3D></e57Root>\n");
  }
  /// With another XML section.
  std::string file(const std::string& xml) const {
    std::string all = bytes_;
    const std::uint64_t begin = physical(all.size());
    all += xml;
    const std::uint64_t pages = (all.size() + 1019) / 1020;
    const std::uint64_t head[] = {std::uint64_t{1}, pages * 1024, begin, xml.size(), 1024};
    all.replace(0, 8, "ASTM-E57");
    std::memcpy(all.data() + 8, head, sizeof head);
    all.resize(pages * 1020, '\0');
    std::string paged;
    for (std::uint64_t p = 0; p < pages; ++p) paged += all.substr(p * 1020, 1020) + std::string(4, '\0');
    return e57_sealed(paged);
  }
  const std::string& scans_xml() const { return scans_; }

 private:
  static std::uint64_t physical(std::size_t logical) { return logical / 1020 * 1024 + logical % 1020; }
  static std::size_t count(const E57Values& f) {
    return f.floats.empty() ? f.integers.size() : f.floats.size();
  }
  void put_at(std::size_t at, std::uint64_t value) { std::memcpy(bytes_.data() + at, &value, 8); }
  void align() { bytes_.resize((bytes_.size() + 3) / 4 * 4, '\0'); }

  static std::string element(const E57Values& f) {
    const bool whole = f.type == "Integer" || f.type == "ScaledInteger";
    std::string text = "<" + f.name + " type=\"" + (whole ? f.type : "Float") + "\"";
    if (f.type == "single") text += " precision=\"single\"";
    if (whole)
      text += " minimum=\"" + std::to_string(f.minimum) + "\" maximum=\"" + std::to_string(f.maximum) + "\"";
    if (f.type == "ScaledInteger") {
      char numbers[80];
      std::snprintf(numbers, sizeof numbers, " scale=\"%.17g\" offset=\"%.17g\"", f.scale, f.offset);
      text += numbers;
    }
    return text + f.more + "/>";
  }

  static std::string stream(const E57Values& f) {
    std::string bytes;
    for (const double v : f.floats) {
      const auto single = static_cast<float>(v);
      char raw[8];
      std::memcpy(raw, f.type == "single" ? static_cast<const void*>(&single) : &v,
                  f.type == "single" ? 4 : 8);
      bytes.append(raw, f.type == "single" ? 4 : 8);
    }
    const auto range = static_cast<std::uint64_t>(f.maximum) - static_cast<std::uint64_t>(f.minimum);
    const auto bits = static_cast<int>(std::bit_width(range));
    int at = 0;  // bits used of the last byte
    for (const std::int64_t v : f.integers) {
      const auto stored = static_cast<std::uint64_t>(v) - static_cast<std::uint64_t>(f.minimum);
      for (int b = 0; b < bits; ++b, at = (at + 1) % 8) {
        if (at == 0) bytes += '\0';
        bytes.back() = static_cast<char>(bytes.back() | static_cast<char>((stored >> b & 1) << at));
      }
    }
    return bytes;
  }

  void packets(const E57TestScan& scan) {
    std::vector<std::string> streams;
    for (const E57Values& f : scan.fields) streams.push_back(stream(f));
    std::vector<std::size_t> done(streams.size(), 0);
    for (std::size_t p = 1; p <= scan.packets; ++p) {
      if (p == 2) bytes_ += std::string("\2\0\7\0....", 8);  // an empty one, for nobody
      const std::size_t begin = bytes_.size();
      std::string head = {1, 0, 0, 0, static_cast<char>(streams.size()), 0};
      std::string pieces;
      for (std::size_t s = 0; s < streams.size(); ++s) {
        const std::size_t lead = scan.skewed && p < scan.packets ? s * scan.packets / 2 : 0;
        const std::size_t until = streams[s].size() * std::min(scan.packets, p + lead) / scan.packets;
        const std::size_t n = until - done[s];
        head += static_cast<char>(n & 0xff);
        head += static_cast<char>(n >> 8);
        pieces += streams[s].substr(done[s], n);
        done[s] = until;
      }
      bytes_ += head + pieces;
      align();
      const std::size_t length = bytes_.size() - begin - 1;
      if (length > 0xffff) throw std::length_error("a packet of an E57 file for tests is too long");
      bytes_[begin + 2] = static_cast<char>(length & 0xff);
      bytes_[begin + 3] = static_cast<char>(length >> 8);
    }
  }

  std::string bytes_;
  std::string scans_;
};

inline std::string e57_file(const std::vector<E57TestScan>& scans) {
  E57Builder builder;
  for (const E57TestScan& s : scans) builder.add(s);
  return builder.file();
}

/// Three fields of one kind: name + X, Y, Z, or the three names given.
inline std::vector<E57Values> e57_doubles(const std::vector<std::string>& names,
                                          const std::vector<std::vector<double>>& values,
                                          const std::string& type = "double") {
  std::vector<E57Values> fields;
  for (std::size_t i = 0; i < names.size(); ++i)
    fields.push_back({names[i], type, values[i], {}, 0, 0, 1.0, 0.0, {}});
  return fields;
}
inline const std::vector<std::string> kE57Cartesian = {"cartesianX", "cartesianY", "cartesianZ"};
inline const std::vector<std::string> kE57Spherical = {"sphericalRange", "sphericalAzimuth",
                                                       "sphericalElevation"};

}  // namespace tessera::test

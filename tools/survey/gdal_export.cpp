// tessera-gdal: writes by GDAL what `tessera raster`, `contours` and `section` have computed, and reads the rasters that `tessera
// volume` counts from. A program of its own, so that `tessera` does not load GDAL and all that it brings. It is called by those
// commands, with a request in their scratch folder.
#include <cpl_conv.h>
#include <cpl_error.h>
#include <gdal_priv.h>
#include <ogr_spatialref.h>
#include <ogrsf_frmts.h>

#include <fcntl.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cmath>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include <fmt/format.h>

#include "octree/error.h"
#include "octree/vector.h"
#include "stream/files/durable_file.h"
#include "stream/files/json.h"
#include "stream/files/path_text.h"
#include "stream/files/read_file.h"
#include "stream/runtime/child_process.h"
#include "stream/runtime/disk_space.h"
#include "stream/runtime/stop.h"
#include "stream/survey/raw_lines.h"
#include "tools/frame/cli.h"

namespace {

using tessera::ResourceError;

struct Arguments {
  std::filesystem::path request;
  std::uint64_t memory_bytes = std::uint64_t{1} << 30;
  int parent = 0;
};

/// What GDAL said last.
std::string& last_error() {
  static std::string text;
  return text;
}

void CPL_STDCALL note_error(CPLErr kind, CPLErrorNum, const char* text) {
  if (kind == CE_Warning) fmt::print(stderr, "tessera: warning: GDAL: {}\n", text);
  if (kind == CE_Failure || kind == CE_Fatal) last_error() = text;
}

[[noreturn]] void fail(const std::string& what) {
  tessera::throw_if_stopped();
  throw ResourceError(what + " could not be written: GDAL says: " + last_error());
}

int CPL_STDCALL go_on(double, const char*, void*) {
  return tessera::stop_signal() == 0 ? TRUE : FALSE;
}

tessera::Json read_request(const Arguments& a) {
  if (a.request.empty())
    throw tessera::UsageError(
        "no request given: this program is called by tessera raster, contours, section and volume");
  if (a.parent != 0) tessera::follow_parent(a.parent);
  // What GDAL itself and the rows at hand take stays below this; what is left is for its cache of blocks.
  constexpr std::uint64_t kOwn = std::uint64_t{128} << 20, kMin = std::uint64_t{16} << 20,
                          kMax = std::uint64_t{512} << 20;
  const std::uint64_t left = a.memory_bytes > kOwn ? a.memory_bytes - kOwn : 0;
  CPLSetErrorHandler(note_error);
  // No side files, no network, and nothing that hangs on the machine.
  CPLSetConfigOption("GDAL_PAM_ENABLED", "NO");
  CPLSetConfigOption("PROJ_NETWORK", "OFF");
  CPLSetConfigOption("GDAL_NUM_THREADS", "1");
  GDALAllRegister();
  GDALSetCacheMax64(static_cast<GIntBig>(std::clamp(left / 2, kMin, kMax)));
  return tessera::parse_json(tessera::read_text(a.request), a.request.string());
}

/// \throws InputError where the text is no coordinate system
std::unique_ptr<OGRSpatialReference> reference_of(const tessera::Json& request) {
  const auto text = request.at("crs").get<std::string>();
  if (text.empty()) return nullptr;
  auto reference = std::make_unique<OGRSpatialReference>();
  reference->SetAxisMappingStrategy(OAMS_TRADITIONAL_GIS_ORDER);
  if (reference->SetFromUserInput(text.c_str(), OGRSpatialReference::SET_FROM_USER_INPUT_LIMITATIONS_get()) !=
      OGRERR_NONE)
    throw tessera::InputError("the coordinate system of the mesh is none that GDAL knows (" +
                              text.substr(0, 80) + "); correct the .prj beside it or name it with --crs");
  return reference;
}

/// Of heights: that of the vertical system, else that of the plane.
std::string height_unit(const OGRSpatialReference& reference) {
  const char* name = nullptr;
  if (reference.IsCompound() && reference.GetTargetLinearUnits("VERT_CS", &name) > 0.0 && name) return name;
  if (reference.IsGeographic()) return "metre";
  reference.GetLinearUnits(&name);
  return name ? name : "";
}

std::filesystem::path path_of(const tessera::Json& request, const char* key) {
  return tessera::bytes_of_json_text(request.at(key).get<std::string>());
}

/// Numbers of the types of cells in ENVI's headers.
int envi_type(const std::string& type) {
  return type == "float" ? 4 : type == "count" ? 13 : 1;
}

/// The raw file, as GDAL's ENVI driver reads it by a header beside it.
std::unique_ptr<GDALDataset> open_raw(const tessera::Json& request) {
  const std::filesystem::path raw = path_of(request, "raw");
  std::filesystem::path header = raw;
  header.replace_extension(".hdr");
  tessera::write_durably(
      header,
      fmt::format("ENVI\nsamples = {}\nlines = {}\nbands = {}\nheader offset = 0\nfile type = ENVI Standard\n"
                  "data type = {}\ninterleave = bip\nbyte order = 0\n",
                  request.at("columns").get<std::int64_t>(), request.at("rows").get<std::int64_t>(),
                  request.at("bands").get<int>(), envi_type(request.at("type").get<std::string>())));
  const std::array<const char*, 2> drivers = {"ENVI", nullptr};
  std::unique_ptr<GDALDataset> set(
      GDALDataset::Open(raw.c_str(), GDAL_OF_RASTER | GDAL_OF_READONLY, drivers.data()));
  if (!set) fail(raw.string());
  return set;
}

void describe_band(GDALRasterBand& band, const tessera::Json& request, int index,
                   const OGRSpatialReference* reference) {
  static const std::array<GDALColorInterp, 4> kColours = {GCI_RedBand, GCI_GreenBand, GCI_BlueBand,
                                                          GCI_AlphaBand};
  const auto quantity = request.at("quantity").get<std::string>();
  if (request.contains("nodata")) band.SetNoDataValue(request.at("nodata").get<double>());
  band.SetColorInterpretation(quantity == "colour" ? kColours[static_cast<std::size_t>(index)]
                                                   : GCI_GrayIndex);
  if (quantity != "colour") band.SetDescription(request.at("layer").get<std::string>().c_str());
  if (quantity == "angle") band.SetUnitType("degree");
  if (quantity == "height" && reference) band.SetUnitType(height_unit(*reference).c_str());
  const tessera::Json& s = request.at("statistics").at(static_cast<std::size_t>(index));
  for (const auto& [name, key] : {std::pair{"STATISTICS_MINIMUM", "minimum"},
                                  {"STATISTICS_MAXIMUM", "maximum"},
                                  {"STATISTICS_MEAN", "mean"},
                                  {"STATISTICS_STDDEV", "deviation"}})
    band.SetMetadataItem(name, fmt::format("{:.17g}", s.at(key).get<double>()).c_str());
  band.SetMetadataItem("STATISTICS_VALID_PERCENT",
                       fmt::format("{:.4g}", request.at("valid_percent").get<double>()).c_str());
}

void write_raster(const Arguments& a) {
  const tessera::Json request = read_request(a);
  const std::unique_ptr<OGRSpatialReference> reference = reference_of(request);
  const std::unique_ptr<GDALDataset> raw = open_raw(request);
  GDALDriver* described = GetGDALDriverManager()->GetDriverByName("VRT");
  const std::unique_ptr<GDALDataset> source(
      described->CreateCopy("", raw.get(), FALSE, nullptr, nullptr, nullptr));
  if (!source) fail("the raster");
  const auto cell = request.at("cell").get<double>();
  std::array<double, 6> transform = {request.at("west").get<double>(),  cell, 0.0,
                                     request.at("north").get<double>(), 0.0,  -cell};
  source->SetGeoTransform(transform.data());
  if (reference) source->SetSpatialRef(reference.get());
  source->SetMetadata(nullptr);
  source->SetMetadataItem("AREA_OR_POINT", "Area");
  for (int band = 1; band <= source->GetRasterCount(); ++band)
    describe_band(*source->GetRasterBand(band), request, band - 1, reference.get());
  CPLStringList options;
  options.SetNameValue("COMPRESS", "DEFLATE");
  options.SetNameValue("PREDICTOR", "YES");
  options.SetNameValue("BLOCKSIZE", "512");
  options.SetNameValue("BIGTIFF", "IF_SAFER");
  options.SetNameValue("SPARSE_OK", "YES");
  options.SetNameValue("OVERVIEW_RESAMPLING", request.at("overviews").get<std::string>().c_str());
  const std::filesystem::path result = path_of(request, "result");
  GDALDriver* cog = GetGDALDriverManager()->GetDriverByName("COG");
  if (!cog)
    throw ResourceError("this GDAL has no driver for Cloud Optimised GeoTIFF (it is there from 3.1 on)");
  std::unique_ptr<GDALDataset> written(
      cog->CreateCopy(result.c_str(), source.get(), FALSE, options.List(), go_on, nullptr));
  if (!written) fail("the raster");
  written->FlushCache();
  written.reset();
  if (!last_error().empty()) fail("the raster");
}

/// Calls use(header, points) for every line of a raw file.
template <class Use>
void for_each_line(const std::filesystem::path& path, const Use& use) {
  const tessera::ReadFile file(path);
  std::vector<tessera::Double3> points;
  for (std::uint64_t at = 0; at < file.size();) {
    tessera::throw_if_stopped();
    tessera::RawLine header;
    file.read_at(at, &header, sizeof header);
    at += sizeof header;
    if (header.count > (file.size() - at) / sizeof points[0])
      throw tessera::InputError(path.string() + ": is damaged: a line is longer than the file");
    points.resize(header.count);
    file.read_at(at, points.data(), header.count * sizeof points[0]);
    at += header.count * sizeof points[0];
    use(header, points);
  }
}

void add_field(OGRLayer& layer, const char* name, OGRFieldType type) {
  OGRFieldDefn field(name, type);
  if (layer.CreateField(&field) != OGRERR_NONE) fail("the lines");
}

/// DXF knows no attributes: what would be one is the name of a layer.
std::string dxf_layer(const tessera::Json& request, const tessera::RawLine& line) {
  if (request.at("layer") == "contours") return line.index != 0 ? "CONTOUR_INDEX" : "CONTOUR";
  return fmt::format("SECTION_{:.10g}", line.value);
}

void write_lines(const Arguments& a) {
  const tessera::Json request = read_request(a);
  std::unique_ptr<OGRSpatialReference> reference = reference_of(request);
  const auto format = request.at("format").get<std::string>();
  const bool dxf = format == "DXF";
  // A GeoPackage says when it was written: always the same, so that equal lines have equal bytes.
  CPLSetConfigOption("OGR_CURRENT_DATE", "2000-01-01T00:00:00.000Z");
  GDALDriver* driver = GetGDALDriverManager()->GetDriverByName(format.c_str());
  if (!driver) throw ResourceError("this GDAL has no driver for " + format);
  // Drivers go by the extension too.
  const std::filesystem::path result = path_of(request, "result");
  std::filesystem::path named = result;
  named += dxf ? ".dxf" : format == "GPKG" ? ".gpkg" : ".geojson";
  std::unique_ptr<GDALDataset> set(driver->Create(named.c_str(), 0, 0, 0, GDT_Unknown, nullptr));
  if (!set) fail("the lines");
  CPLStringList options;
  // What doubles need to come back as they are, and no more.
  if (format == "GeoJSON") options.SetNameValue("SIGNIFICANT_FIGURES", "17");
  OGRLayer* layer = set->CreateLayer(dxf ? "entities" : request.at("layer").get<std::string>().c_str(),
                                     dxf ? nullptr : reference.get(), wkbLineString25D, options.List());
  if (!layer) fail("the lines");
  const auto value = request.at("value").get<std::string>(), index = request.at("index").get<std::string>();
  if (!dxf) {
    add_field(*layer, value.c_str(), OFTReal);
    add_field(*layer, index.c_str(), OFTInteger);
    add_field(*layer, "closed", OFTInteger);
  }
  const bool transactions = set->StartTransaction() == OGRERR_NONE;
  for_each_line(path_of(request, "raw"), [&](const tessera::RawLine& header, const auto& points) {
    OGRLineString line;
    const std::size_t count = points.size() + (header.closed != 0 ? 1 : 0);
    line.setNumPoints(static_cast<int>(count));
    for (std::size_t k = 0; k < count; ++k) {
      const auto& p = points[k % points.size()];
      line.setPoint(static_cast<int>(k), p[0], p[1], p[2]);
    }
    OGRFeature feature(layer->GetLayerDefn());
    feature.SetGeometry(&line);
    if (dxf) {
      feature.SetField("Layer", dxf_layer(request, header).c_str());
    } else {
      feature.SetField(value.c_str(), header.value);
      feature.SetField(index.c_str(), static_cast<int>(header.index));
      feature.SetField("closed", static_cast<int>(header.closed));
    }
    if (layer->CreateFeature(&feature) != OGRERR_NONE) fail("the lines");
  });
  if (transactions && set->CommitTransaction() != OGRERR_NONE) fail("the lines");
  set.reset();
  if (!last_error().empty()) fail("the lines");
  std::filesystem::rename(named, result);
}

/// A file of doubles, row by row.
class RawHeights {
 public:
  explicit RawHeights(std::filesystem::path path)
      : path_(std::move(path)),
        fd_(::open(path_.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_NOFOLLOW | O_CLOEXEC, 0600)) {
    if (fd_ < 0) tessera::throw_write_error(path_, errno);
  }
  ~RawHeights() { ::close(fd_); }
  RawHeights(const RawHeights&) = delete;
  RawHeights& operator=(const RawHeights&) = delete;
  void write(std::uint64_t index, const double* from, std::uint64_t count) {
    if (const int error = tessera::write_all_at(fd_, from, count * sizeof(double), index * sizeof(double)))
      tessera::throw_write_error(path_, error);
  }

 private:
  std::filesystem::path path_;
  int fd_;
};

/// A GeoTIFF whose only band are heights. \throws InputError saying what else it is
std::unique_ptr<GDALDataset> open_heights(const tessera::Json& request, std::array<double, 6>& transform) {
  const std::string name = path_of(request, "name").string();
  const std::array<const char*, 2> drivers = {"GTiff", nullptr};
  std::unique_ptr<GDALDataset> set(GDALDataset::Open(path_of(request, "raster").c_str(),
                                                     GDAL_OF_RASTER | GDAL_OF_READONLY, drivers.data()));
  if (!set) throw tessera::InputError(name + ": is no GeoTIFF that GDAL reads: " + last_error());
  if (set->GetRasterCount() != 1)
    throw tessera::InputError(
        fmt::format("{}: has {} bands; heights are a GeoTIFF of one band", name, set->GetRasterCount()));
  const GDALDataType type = set->GetRasterBand(1)->GetRasterDataType();
  if (GDALDataTypeIsComplex(type))
    throw tessera::InputError(name + ": its values are complex numbers, not heights");
  if (set->GetGeoTransform(transform.data()) != CE_None ||
      !(std::abs(transform[1] * transform[5] - transform[2] * transform[4]) > 0.0))
    throw tessera::InputError(name +
                              ": is not georeferenced, so nobody knows where its heights lie; give it a "
                              "place, as by gdal_edit.py -a_ullr");
  return set;
}

void read_heights(const Arguments& a) {
  const tessera::Json request = read_request(a);
  std::array<double, 6> transform{};
  const std::unique_ptr<GDALDataset> set = open_heights(request, transform);
  const std::string name = path_of(request, "name").string();
  const std::filesystem::path result = path_of(request, "result");
  GDALRasterBand& band = *set->GetRasterBand(1);
  const int columns = band.GetXSize(), rows = band.GetYSize();
  const auto cells = static_cast<std::uint64_t>(columns) * static_cast<std::uint64_t>(rows);
  tessera::require_disk(
      std::array{tessera::DiskNeed{result.parent_path(), cells * sizeof(double), "the heights of " + name}},
      tessera::kLargerDisk);
  int block_columns = 0, block_rows = 0;
  band.GetBlockSize(&block_columns, &block_rows);
  // Whole blocks at a time, as many side by side as 16 MiB hold.
  constexpr int kMost = 1 << 20;
  const int height = std::clamp(block_rows, 1, std::min(rows, 1024));
  const int width = std::min(columns, std::max(1, kMost / height / std::max(1, block_columns)) *
                                          std::max(1, std::min(block_columns, kMost / height)));
  int scaled = FALSE;
  const double scale = band.GetScale(&scaled), offset = band.GetOffset(nullptr);
  RawHeights out(result);
  std::vector<double> values(static_cast<std::size_t>(width) * static_cast<std::size_t>(height));
  std::vector<unsigned char> mask(values.size());
  double low = HUGE_VAL, high = -HUGE_VAL;
  for (int y = 0; y < rows; y += height)
    for (int x = 0; x < columns; x += width) {
      tessera::throw_if_stopped();
      const int w = std::min(width, columns - x), h = std::min(height, rows - y);
      if (band.RasterIO(GF_Read, x, y, w, h, values.data(), w, h, GDT_Float64, 0, 0, nullptr) != CE_None ||
          band.GetMaskBand()->RasterIO(GF_Read, x, y, w, h, mask.data(), w, h, GDT_Byte, 0, 0, nullptr) !=
              CE_None)
        throw tessera::InputError(name + ": cannot be read: GDAL says: " + last_error());
      for (std::size_t k = 0; k < static_cast<std::size_t>(w) * static_cast<std::size_t>(h); ++k) {
        if (scaled != FALSE) values[k] = values[k] * scale + offset;
        if (mask[k] == 0 || !std::isfinite(values[k])) {
          values[k] = std::nan("");
          continue;
        }
        low = std::min(low, values[k]), high = std::max(high, values[k]);
      }
      for (int r = 0; r < h; ++r)
        out.write(static_cast<std::uint64_t>(y + r) * static_cast<std::uint64_t>(columns) +
                      static_cast<std::uint64_t>(x),
                  &values[static_cast<std::size_t>(r) * static_cast<std::size_t>(w)],
                  static_cast<std::uint64_t>(w));
    }
  if (!(low <= high)) throw tessera::InputError(name + ": has no height at all, every cell says no data");
  std::string crs;
  if (const OGRSpatialReference* reference = set->GetSpatialRef()) {
    char* text = nullptr;
    const std::array<const char*, 2> options = {"FORMAT=WKT2_2019", nullptr};
    if (reference->exportToWkt(&text, options.data()) == OGRERR_NONE && text) crs = text;
    CPLFree(text);
  }
  tessera::write_durably(path_of(request, "info"), tessera::dump_json(tessera::Json{{"columns", columns},
                                                                                    {"rows", rows},
                                                                                    {"transform", transform},
                                                                                    {"low", low},
                                                                                    {"high", high},
                                                                                    {"crs", crs}}));
}

}  // namespace

int main(int argc, char** argv) {
  auto a = std::make_shared<Arguments>();
  tessera::OptionTable t;
  t.add("request", &a->request, "what to do, as tessera raster, contours, section and volume say it")
      .positional();
  t.add("memory", &a->memory_bytes, "cap on memory").bytes();
  t.add("driven", &a->parent, "process that drives this one").hidden();
  return tessera::cli::run(
      "tessera-gdal",
      "Writes and reads foreign files by GDAL for tessera raster, contours, section and volume, which call "
      "it.",
      {{"raster", "Raw cells to a Cloud Optimised GeoTIFF.", t, [a] { write_raster(*a); }},
       {"lines", "Raw lines to GeoPackage, GeoJSON or DXF.", t, [a] { write_lines(*a); }},
       {"heights", "A GeoTIFF of one band to raw heights.", t, [a] { read_heights(*a); }}},
      argc, argv);
}

/// \file measured_inputs.h
/// What commands measure at every point: scans, or the vertices of a mesh, read once to be measured and once more to be written
/// with what was found, as scalars. A LAS or LAZ file that is written as .las or .laz keeps all that it has, and its
/// records get extra bytes.
#pragma once
#include <cstdint>
#include <filesystem>
#include <functional>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "stream/meshes/mesh_weld.h"
#include "stream/survey/measured_points.h"
#include "stream/survey/scalar_files.h"

namespace tessera {

struct MeasuredInputOptions {
  std::vector<std::string> scalars;  ///< names; less than 32 bytes each
  std::vector<std::string> columns;  ///< of text scans
  bool anew = false;  ///< points are written with other colours, or not all of them: never copied as records
  bool recoloured = false;  ///< the second pass gives every point a colour
  std::uint64_t memory_bytes = 0;
  int threads = 0;
  std::filesystem::path scratch;  ///< folder
};

class MeasuredInputs {
 public:
  /// What inputs are refused for they are refused for here.
  /// \param inputs  one mesh, or scans  \param outputs  none, one, or one for each of several LAS and LAZ files
  /// \throws InputError; UsageError as LasCopy, and for several meshes
  MeasuredInputs(std::vector<std::filesystem::path> inputs, std::vector<std::filesystem::path> outputs,
                 MeasuredInputOptions options);

  const MeasuredPoints& points() const { return *points_; }
  /// The first pass: positions in order; those that take no part have a coordinate that is no number.
  /// \throws as the readers do; EmptyError where no position is finite
  void read(const std::function<void(const Double3&)>& sink);
  // After the first pass.
  std::uint64_t finite() const { return finite_; }
  std::uint64_t left_out() const { return left_out_; }  ///< withheld, placeholders, missing, not finite
  const Double3& min() const { return min_; }           ///< of the finite ones
  const Double3& max() const { return max_; }

  /// What is known of a point in the second pass: its scalars, and the colour that it gets where it gets one.
  struct Found {
    std::span<double> scalars;
    std::uint32_t rgba = 0;
  };
  /// The second pass: every point in order to measured(position, found), which fills `found` and says whether the point is
  /// written, as it is where records are copied. \throws InputError where the inputs have changed
  void write(const std::function<bool(const Double3&, Found&)>& measured);
  /// So many slices of a file may wait in memory.
  std::size_t slice_window() const;
  /// Gives the output its name. Returns the bytes of all outputs. \pre write()
  std::uint64_t finish();

  /// \throws UsageError for an extension that no output has \param what  "deviations"
  static void require_output(const std::filesystem::path& output, const std::string& what);

 private:
  bool copies_records() const;
  void write_records(std::size_t file, const std::function<bool(const Double3&, Found&)>& measured);
  std::unique_ptr<ScalarFile> create_file(const std::filesystem::path& output);
  void count_given();

  std::vector<std::filesystem::path> inputs_, outputs_;
  MeasuredInputOptions options_;
  std::unique_ptr<MeshReader> mesh_;
  std::unique_ptr<WeldedMesh> welded_;
  std::vector<LasRecords> records_;  ///< of files that are copied with scalars
  std::unique_ptr<MeasuredPoints> points_;
  Double3 min_{}, max_{};
  bool exact_in_float_ = true;
  std::uint64_t all_ = 0, finite_ = 0, left_out_ = 0, given_ = 0, bytes_ = 0;
  std::unique_ptr<ScalarFile> file_;
};

/// Of a signed distance: grey to red in front, to blue behind, magenta beyond the scale; dark grey for NaN.
std::uint32_t measured_colour(double distance, double scale);
/// Whether its vertices are measured, not the points of a scan.
bool measures_vertices(const std::filesystem::path& input);

}  // namespace tessera

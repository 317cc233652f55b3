/// \file text_columns.h
/// What the columns of a text file mean, how its numbers are written, and one line's fields.
#pragma once
#include <array>
#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

namespace tessera {

/// What a column holds. The first nine are the values of a point, in the order of their slots.
enum class TextColumn : std::uint8_t { kX, kY, kZ, kNx, kNy, kNz, kRed, kGreen, kBlue, kIntensity, kOther };
inline constexpr std::size_t kTextSlots = 9;

/// By name: case, quotes and a unit in brackets do not matter. kOther if unknown.
TextColumn text_column(std::string_view name);
/// The name that the column has in messages.
std::string_view text_column_name(TextColumn column);

/// How the lines of a file are cut into numbers.
struct TextDialect {
  char delimiter = ' ';        ///< ',' ';' '\t': fields may be empty; ' ': runs of white space and commas
  bool decimal_comma = false;  ///< 1,5 is one and a half

  /// The line as parse() wants it: with decimal points. \param buffer  holds it where it differs
  std::string_view plain(std::string_view line, std::string& buffer) const;
};

/// Tells the dialect from the first lines: commas are decimal where they stand between the digits of three fields a line
/// or more (fewer where semicolons or tabs are between fields) and no number has a point.
class TextDialectVote {
 public:
  void add(std::string_view line);
  /// \param first  the first line of points
  TextDialect decide(std::string_view first) const;

 private:
  std::size_t decimal_ = 0, other_ = 0;
};

class TextColumns {
 public:
  TextColumns() : TextColumns(std::vector<TextColumn>()) {}
  explicit TextColumns(std::vector<TextColumn> columns);
  /// Of a header line or of --columns. Where names of several kinds mean one value (x and easting, r and rf), the plainest
  /// counts.
  static TextColumns named(const std::vector<std::string>& names);

  bool has(TextColumn column) const { return at_[static_cast<std::size_t>(column)] >= 0; }
  bool positions() const { return has(TextColumn::kX) && has(TextColumn::kY) && has(TextColumn::kZ); }
  bool normals() const { return has(TextColumn::kNx) && has(TextColumn::kNy) && has(TextColumn::kNz); }
  bool colours() const { return has(TextColumn::kRed) && has(TextColumn::kGreen) && has(TextColumn::kBlue); }
  /// x and y are named longitude and latitude.
  bool geographic() const { return geographic_; }
  /// Colours are named as those of 0..1 are.
  bool unit_colours() const { return unit_colours_; }
  std::size_t count() const { return columns_.size(); }
  /// Whether every column means something here.
  bool all_known() const;
  /// First column that is there twice, or kOther.
  TextColumn repeated() const { return repeated_; }
  /// "x y z nx ny nz", other columns as "_".
  std::string names() const;
  /// Columns that mean nothing here, but for those named to be skipped: by name, or as "column 7".
  std::vector<std::string> left_out() const;

  /// Values of a line by slot. False if a field that is needed is not there or no number.
  /// \param delimiter  of TextDialect; an empty field gives NaN
  bool parse(std::string_view line, char delimiter, std::array<double, kTextSlots>& values) const;
  /// Whether a colour of the line is written with a decimal point or an exponent.
  bool has_pointed_colours(std::string_view line, char delimiter) const;

 private:
  std::vector<TextColumn> columns_;
  std::vector<std::string> names_;  ///< as given, or none
  std::size_t needed_ = 0;          ///< columns up to the last that is a value of a point
  std::array<int, 11> at_{};
  TextColumn repeated_ = TextColumn::kOther;
  bool geographic_ = false;
  bool unit_colours_ = false;
};

/// ',' ';' or '\t' if the line is in the way of CSV, else ' '.
char text_delimiter(std::string_view line);
/// Takes the next field, without quotes and blanks around it. False at the end of the line.
bool next_field(std::string_view& line, char delimiter, std::string_view& field);

}  // namespace tessera

/// \file text_columns.h
/// What the columns of a text file mean, and one line's fields.
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

class TextColumns {
 public:
  TextColumns() : TextColumns(std::vector<TextColumn>()) {}
  explicit TextColumns(std::vector<TextColumn> columns);

  bool has(TextColumn column) const { return at_[static_cast<std::size_t>(column)] >= 0; }
  bool positions() const { return has(TextColumn::kX) && has(TextColumn::kY) && has(TextColumn::kZ); }
  bool normals() const { return has(TextColumn::kNx) && has(TextColumn::kNy) && has(TextColumn::kNz); }
  bool colours() const { return has(TextColumn::kRed) && has(TextColumn::kGreen) && has(TextColumn::kBlue); }
  std::size_t count() const { return columns_.size(); }
  /// First column that is there twice, or kOther.
  TextColumn repeated() const { return repeated_; }
  /// "x y z nx ny nz", other columns as "_".
  std::string names() const;

  /// Values of a line by slot. False if a field that is needed is not there or no number.
  /// \param delimiter  ',' ';' '\t': fields may be empty, which gives NaN; ' ': runs of white space and commas
  bool parse(std::string_view line, char delimiter, std::array<double, kTextSlots>& values) const;

 private:
  std::vector<TextColumn> columns_;
  std::size_t needed_ = 0;  ///< columns up to the last that is a value of a point
  std::array<int, 11> at_{};
  TextColumn repeated_ = TextColumn::kOther;
};

/// ',' ';' or '\t' if the line is in the way of CSV, else ' '.
char text_delimiter(std::string_view line);
/// Takes the next field, without quotes and blanks around it. False at the end of the line.
bool next_field(std::string_view& line, char delimiter, std::string_view& field);

}  // namespace tessera

/// \file survey_page.h
/// What a survey command found (deviations, sections, volumes, ...) as one HTML file to read and to print on A4: it holds all
/// that it shows, runs no script, and a policy in its head forbids it to load anything. All texts are plain: they are escaped here.
#pragma once
#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "octree/vector.h"
#include "stream/page/html.h"
#include "stream/page/plan_drawing.h"

namespace tessera {

using PageRows = std::vector<std::pair<std::string, std::string>>;  ///< name, value

struct PageVerdict {
  bool passed = false;
  std::string text;  ///< what was asked for and what was found
};

/// Colours of a picture, from `low` to `high` as deviation_colour() has them.
struct PageScale {
  double low = 0.0, high = 0.0;  ///< low = -high where both sides have colours
  std::string title, unit;
  std::vector<std::pair<std::string, std::string>> others;  ///< colour (#rrggbb) and what it means
};

struct PagePicture {
  std::string png, alternative, caption;
};

/// Found somewhere; its number is that in the pictures.
struct PagePlace {
  Double3 at{};
  std::vector<std::string> values;  ///< as SurveyPage::place_columns
};

struct PageTable {
  std::string title;
  std::vector<std::string> columns;  ///< the first names the row
  std::vector<std::vector<std::string>> rows;
  std::string note;
};

struct PageDrawing {
  std::string title;
  PageRows facts;
  PlanDrawing drawing;
};

/// In the order of the page. What is empty is left out.
struct SurveyPage {
  std::string title, subject;  ///< "Deviations"; what was measured
  std::string command;         ///< "deviate"
  std::optional<PageVerdict> verdict;
  PageRows headlines;  ///< a few figures in large letters: what, figure
  std::vector<std::string> notices;
  PageRows inputs;
  PageRows figures;
  std::optional<html::Histogram> histogram;
  std::optional<PageScale> scale;
  std::vector<PagePicture> pictures;
  std::string pictures_note;  ///< beside them, or why there are none
  std::vector<std::string> place_columns;
  std::vector<PagePlace> places;
  std::string places_note;
  std::string tables_title;
  std::vector<PageTable> tables;
  std::string drawings_title, drawings_note;
  std::vector<PageDrawing> drawings;
};

/// \post  a pure function of the page
std::string survey_page_text(const SurveyPage& page);

/// Coordinates as tables and messages show them: ten digits.
std::string place_text(const Double3& p);

/// \throws UsageError where the name of a page ends in neither .html nor .htm; an empty one is none
void require_page_name(const std::filesystem::path& path);

}  // namespace tessera

#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "base/machine.h"
#include "base/profile.h"
#include "eval/report.h"
#include "eval/report_pictures.h"

namespace traceflow::eval {

// A setting of the run, and what it would be unless somebody had changed it.
struct Setting {
  std::string path, value, usual, unit, help;
};

struct PhaseReport {
  std::string name;
  int64_t first = 0, last = 0;        // iterations, counted from 1
  double seconds = 0;                 // of training
  std::vector<profile::Entry> steps;  // where they went
};

// All that the page of a run shows.
struct ReportPage {
  std::string version;  // of the program that measured
  std::string made;     // ISO 8601, UTC
  std::string run;      // name of the run's folder
  Machine machine;      // that measured; the one that trained is told by the event "started"
  Report report;
  std::vector<Setting> settings;
  std::vector<PhaseReport> phases;
  std::vector<std::string> events;  // of the log, each an object as JSON
  std::vector<ReportPicture> pictures;
};

// The page: one HTML file that needs nothing else, under 15 MB. ReportPictures keep to a budget that leaves
// the rest ample room; where that is not enough, because a capture has very many views, the last pictures are
// left out. What is shown is JSON, of the shape that web/src/report/data.ts says, with no `<` in it: no name
// or text can end the element that holds it.
std::string report_page(const ReportPage& page);

// The same into another template, whose element <script type="application/json" id="report"> holds `null`.
std::string report_page(const ReportPage& page, std::string_view html);

}  // namespace traceflow::eval

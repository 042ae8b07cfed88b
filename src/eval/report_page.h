#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "base/machine.h"
#include "eval/report.h"
#include "eval/report_pictures.h"
#include "record/log_history.h"

namespace traceflow::eval {

// A changed setting of the run, with its default.
struct Setting {
  std::string path, value, usual, unit, help;
};

// The content of a run's page.
struct ReportPage {
  std::string version;  // of the program that measured
  std::string made;     // ISO 8601, UTC
  std::string run;      // name of the run's folder
  Machine machine;      // that measured; the event "started" names the one that trained
  Report report;
  std::vector<Setting> settings;
  std::vector<LoggedPhase> phases;
  std::vector<std::string> events;  // of the log, each a JSON object
  std::vector<ReportPicture> pictures;
};

// The page: one self-contained HTML file below 15 MB. ReportPictures have a budget that leaves ample space
// for the rest. If a capture has so many views that this is not enough, the last pictures are left out. The
// data is JSON, as defined in web/src/report/data.ts. It contains no `<`, so no name or text can end the HTML
// element around it.
std::string report_page(const ReportPage& page);

// The same with another template, whose element <script type="application/json" id="report"> contains `null`.
std::string report_page(const ReportPage& page, std::string_view html);

}  // namespace traceflow::eval

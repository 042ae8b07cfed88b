#include "cli/arguments/option_page.h"

#include <fmt/format.h>

#include "base/error.h"
#include "train/options.h"

namespace traceflow::cli {

namespace {

std::string row(const std::vector<std::string>& cells) {
  std::string line = "|";
  for (const std::string& cell : cells) line += " " + cell + " |";
  return line + "\n";
}

}  // namespace

std::string option_table(const std::vector<OptionColumn>& columns) {
  require(!columns.empty(), "a table of options has a column");
  std::vector<std::string> head{"option"};
  for (const OptionColumn& column : columns) head.push_back(column.title);
  head.insert(head.end(), {"unit", "meaning"});
  std::string table = row(head) + row(std::vector<std::string>(head.size(), "---"));
  for (size_t i = 0; i < columns.front().fields.size(); ++i) {
    const OptionField& field = columns.front().fields[i];
    std::vector<std::string> cells{"`" + field.path + "`"};
    for (const OptionColumn& column : columns) cells.push_back(option_text(column.fields.at(i).get()));
    cells.insert(cells.end(), {field.unit, field.full_help()});
    table += row(cells);
  }
  return table;
}

std::string option_page() {
  TrainOptions paper = preset("paper");
  TrainOptions cpu = preset("cpu");
  TrainOptions demo = preset("demo");
  return fmt::format(
      R"(# Options

Written by `traceflow --help-options`; do not edit.

`traceflow train` begins with a preset (`--preset paper`, `cpu` or `demo`), then reads a TOML file (`--config FILE`, groups as
tables), then assignments (`--set loss.normal=0`, repeated at will), then flags (`--iterations 5000`; only for options outside
groups and for those of `capture`). A name that does not exist ends the program with the nearest one that does. The settings
that a run was made with are kept in its checkpoint.

{})",
      option_table(
          {{"paper", option_fields(paper)}, {"cpu", option_fields(cpu)}, {"demo", option_fields(demo)}}));
}

}  // namespace traceflow::cli

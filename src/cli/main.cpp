#include "cli/program.h"

int main(int argc, char** argv) { return traceflow::cli::run(argc, argv); }

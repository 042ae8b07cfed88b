# Sourced by .ci/run and scripts/nightly, which run one check after another.
#   stage NAME         begins a check, and ends the one before
#   print_stages       ends the last one, and prints how long each took

stage_names=() stage_starts=()

stage() {
  stage_names+=("$1") stage_starts+=("$SECONDS")
  printf '== %s (%d:%02d)\n' "$1" $((SECONDS / 60)) $((SECONDS % 60))
}

print_stages() {
  local i end=$SECONDS took
  stage_starts+=("$end")
  echo "minutes  stage"
  for i in "${!stage_names[@]}"; do
    took=$((stage_starts[i + 1] - stage_starts[i]))
    printf '%4d:%02d  %s\n' $((took / 60)) $((took % 60)) "${stage_names[i]}"
  done
  printf '%4d:%02d  in all\n' $((end / 60)) $((end % 60))
}

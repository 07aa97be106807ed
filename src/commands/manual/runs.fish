
# Sources may be live runs: `live`, `live:RUN`.
complete -c beadline -n "__fish_seen_subcommand_from @ANALYSES@ plot record" \
    -a "live live:(beadline ls --names 2>/dev/null)"

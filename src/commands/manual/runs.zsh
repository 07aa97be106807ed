# Sources may be live runs: `live`, `live:RUN`.
_beadline_sources() {
    local -a runs
    runs=(live live:${^${(f)"$(_call_program runs beadline ls --names 2>/dev/null)"}})
    compadd -a runs
    _files
}

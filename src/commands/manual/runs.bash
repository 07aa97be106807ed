
# Sources may be live runs: `live`, `live:RUN`.
_beadline_with_runs() {
    local word="${COMP_LINE:0:COMP_POINT}" before run strip="" found
    before="${word%"${word##*[[:space:]]}"}"
    word="${word##*[[:space:]]}"
    before="${before%"${before##*[![:space:]]}"}"
    before="${before##*[[:space:]]}"
    case "${COMP_WORDS[1]}" in
        @ANALYSES@ | plot | record) ;;
        *)
            _beadline "$@"
            return
            ;;
    esac
    # behind a flag stands its value; without a first letter flags are as welcome
    if [[ "$COMP_CWORD" -lt 2 || "$before" == -* || -z "$word" || ( "live:" != "$word"* && "$word" != live:* ) ]]; then
        _beadline "$@"
        return
    fi
    # what stands before a colon is no part of the word that bash replaces
    [[ "$word" == *:* && "$COMP_WORDBREAKS" == *:* ]] && strip="${word%"${word##*:}"}"
    COMPREPLY=()
    for run in live $("${COMP_WORDS[0]}" ls --names 2>/dev/null); do
        [[ "$run" == live ]] && found="$run" || found="live:$run"
        [[ "$found" == "$word"* ]] && COMPREPLY+=("${found#"$strip"}")
    done
    while IFS= read -r found; do
        COMPREPLY+=("$found")
    done < <(compgen -f -- "$word")
}
complete -F _beadline_with_runs -o bashdefault -o default beadline

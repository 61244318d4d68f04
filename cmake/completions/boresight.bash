# Completion of boresight for bash. What it offers it reads from the program's --help.

_boresight_commands() {
    "$1" --help | sed -n '/^commands:/,/^$/s/^  \([a-z-]*\) .*/\1/p'
}

# "--name ARGUMENT" of each option of a command.
_boresight_options() {
    "$1" help "$2" 2>/dev/null | sed -n '/options:$/,$s/^  \(--[a-z-]*\) \{0,1\}\([^ ]*\) .*/\1 \2/p'
}

_boresight() {
    local program=$1 word=$2 previous=$3 command='' i argument='' files=no
    local offers
    COMPREPLY=()
    for ((i = 1; i < COMP_CWORD; i++)); do
        case ${COMP_WORDS[i]} in
            --plugin) ((i++)) ;;
            -*) ;;
            *)
                command=${COMP_WORDS[i]}
                break
                ;;
        esac
    done
    if [[ -z $command || $command == help ]]; then
        case $previous in
            --plugin) files=yes ;;
            *) offers="$(_boresight_commands "$program") help --help --version --plugin --no-plugins" ;;
        esac
    else
        if [[ $previous =~ ^--[a-z-]+$ ]]; then # safe as a pattern
            argument=$(_boresight_options "$program" "$command" | sed -n "s/^$previous //p")
        fi
        case $previous:$argument in
            --*:*'|'*) offers=${argument//|/ } ;;
            --*:?*) files=yes ;;
            *)
                case $word in
                    -*) offers=$(_boresight_options "$program" "$command" | cut -d ' ' -f 1) ;;
                    *) files=yes ;;
                esac
                ;;
        esac
    fi
    if [[ $files == yes ]]; then
        compopt -o filenames 2>/dev/null
        mapfile -t COMPREPLY < <(compgen -f -- "$word")
    else
        mapfile -t COMPREPLY < <(compgen -W "$offers" -- "$word")
    fi
}

complete -F _boresight boresight

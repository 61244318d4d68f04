# Completion of boresight for fish. What it offers it reads from the program's --help.

# The command of the line so far; fails if there is none.
function __boresight_command
    set -l words (commandline -opc)[2..-1]
    while set -q words[1]
        switch $words[1]
            case --plugin
                set -e words[1]
            case '-*'
            case '*'
                echo $words[1]
                return 0
        end
        set -e words[1]
    end
    return 1
end

function __boresight_commands
    boresight --help | sed -n '/^commands:/,/^$/s/^  \([a-z-]*\)  *\(.*\)/\1\t\2/p'
end

# "--name ARGUMENT" and what it does, separated by a tab.
function __boresight_table
    boresight help (__boresight_command) 2>/dev/null |
        sed -n '/options:$/,$s/^  \(--[a-z-]*\) \{0,1\}\([^ ]*\)  *\(.*\)/\1 \2\t\3/p'
end

# Argument of the option before the cursor.
function __boresight_argument
    set -l previous (commandline -opc)[-1]
    string match -q -- '--*' $previous
    and __boresight_table | sed -n "s/^$previous \([^\t][^\t]*\)\t.*/\1/p"
end

function __boresight_options
    test -z (__boresight_argument); or return
    __boresight_table | sed 's/ [^\t]*\t/\t/'
end

function __boresight_choices
    string match -r -- '.*\|.*' (__boresight_argument) | string split '|'
end

complete -c boresight -n 'not __boresight_command >/dev/null' -f -a '(__boresight_commands)'
complete -c boresight -n 'not __boresight_command >/dev/null' -f -a 'help --help --version --no-plugins'
complete -c boresight -n 'not __boresight_command >/dev/null' -l plugin -r -F
complete -c boresight -n '__boresight_command | string match -q help' -f -a '(__boresight_commands)'
complete -c boresight -n '__boresight_command; and __boresight_choices' -f -a '(__boresight_choices)'
complete -c boresight -n '__boresight_command; and string match -q -- "-*" (commandline -ct)' -a '(__boresight_options)'

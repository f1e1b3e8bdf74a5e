"""What Windows does not have of the standard library."""

MODULES = ("fcntl", "resource", "pwd", "grp", "termios", "tty", "pty", "syslog")
MISSING = {
    "os": (
        "fork", "forkpty", "killpg", "getpgrp", "getpgid", "setpgid", "setsid", "getsid", "getuid", "geteuid", "getgid", "getegid",
        "getgroups", "getresuid", "uname", "wait", "wait3", "wait4", "waitid", "WNOHANG", "sysconf", "confstr", "getloadavg", "nice",
        "chown", "lchown", "fchown", "fchmod", "chroot", "statvfs", "fstatvfs", "mkfifo", "mknod", "pread", "pwrite", "posix_spawn",
        "posix_spawnp", "sched_getaffinity", "sched_setaffinity", "sched_yield", "register_at_fork", "getrandom", "O_NONBLOCK",
        "O_CLOEXEC", "O_DIRECTORY", "O_NOFOLLOW", "O_SYNC", "ttyname", "openpty", "sendfile",
    ),
    "signal": (
        "SIGKILL", "SIGHUP", "SIGQUIT", "SIGUSR1", "SIGUSR2", "SIGALRM", "SIGCHLD", "SIGPIPE", "SIGCONT", "SIGSTOP", "SIGTSTP",
        "SIGWINCH", "SIGXCPU", "SIGXFSZ", "alarm", "setitimer", "pause", "pthread_sigmask", "pthread_kill", "sigwait", "sigpending",
        "siginterrupt", "SIG_BLOCK", "SIG_UNBLOCK", "SIG_SETMASK",
    ),
    "select": (
        "poll", "epoll", "kqueue",
    ),
}  # fmt: skip

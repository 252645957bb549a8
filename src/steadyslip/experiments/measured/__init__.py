"""From files of a laboratory to a clean record, with a note of everything that was done to it."""

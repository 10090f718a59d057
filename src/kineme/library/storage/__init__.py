"""The database: tables, versions, checksums, locks; reading and verifying."""
